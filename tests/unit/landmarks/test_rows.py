"""Events as rows of the database."""

import json
import math
from dataclasses import replace

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given, settings

from landmark_maps.examples import (
    LABEL_STREAM,
    ORIGIN,
    associated,
    closing,
    frame,
    label,
    label_gain,
    logged,
    solved_landmark,
    solved_map,
    whole_change,
)
from trigpoint.events.corrected import AnchorRetracted, Corrected
from trigpoint.events.envelope import LogPosition
from trigpoint.events.mapped import LandmarkSolved, Mapped
from trigpoint.events.solved_landmarks import by_drive, in_columns
from trigpoint.landmarks.model import Landmark, MapChange, provenance_json
from trigpoint_landmarks.core.rows import HELD_LENGTH, labels_within, landmark_rows, make_valid, map_change
from trigpoint_landmarks.core.versions import solved_versions


def changed(map_version: int, landmarks: list[LandmarkSolved], held: MapChange | None = None) -> MapChange:
    """The change a version of these landmarks makes after `held`."""
    (version,) = solved_versions(logged(solved_map(map_version, landmarks)))
    return map_change(version, frame=frame(), labels={}, valid=valid_with(held) if held else {})


def valid_with(*changes: MapChange) -> dict[str, Landmark]:
    """The valid landmarks once the changes are made."""
    valid: dict[str, Landmark] = {}
    for change in changes:
        make_valid(valid, change)
    return valid


def test_a_landmark_stands_at_its_grid_position() -> None:
    (row,) = changed(1, [solved_landmark("L1", 1.5, -2.5)]).opened
    assert (row.easting_m, row.northing_m) == (ORIGIN.easting_m + 1.5, ORIGIN.northing_m - 2.5)


def test_a_landmark_at_the_origin_is_in_victoria_park() -> None:
    (row,) = changed(1, [solved_landmark("L1", 0.0, 0.0)]).opened
    # 332 000 E, 6 248 000 N in zone 56 south by Krueger's series to n^3, worked out apart; 1e-7 degrees are 1 cm.
    assert (row.lat_deg, row.lon_deg) == pytest.approx((-33.89500332, 151.18313961), abs=1e-7)


def test_the_ellipse_is_that_of_the_covariance() -> None:
    (row,) = changed(1, [solved_landmark("L1", 0.0, 0.0)]).opened
    along = np.array([math.cos(row.ellipse_heading_rad), math.sin(row.ellipse_heading_rad)])
    # Variance along the longer axis is its square, and the product of the squares the determinant; rounding only.
    assert along @ row.covariance_m2 @ along == pytest.approx(row.sigma_major_m**2, rel=1e-12)
    assert (row.sigma_major_m * row.sigma_minor_m) ** 2 == pytest.approx(0.04 * 0.09 - 0.01**2, rel=1e-12)


def test_a_landmark_names_its_observations() -> None:
    (row,) = changed(1, [solved_landmark("L1", 0.0, 0.0)]).opened
    sweeps = [("/".join(drive), sequence) for *drive, sequence in solved_landmark("L1", 0.0, 0.0).observations]
    assert [(drive, seq) for drive, seqs in json.loads(row.provenance).items() for seq in seqs] == sweeps


def test_a_landmark_is_anchored_by_the_anchors_it_names() -> None:
    rows = changed(1, [solved_landmark("L1", 0.0, 0.0), solved_landmark("L2", 0.0, 9.0)]).opened
    assert [(row.anchored, row.anchors) for row in rows] == [(True, ("anchor-1",)), (False, ())]


def test_a_landmark_solved_exactly_as_before_keeps_its_row() -> None:
    first = changed(1, [solved_landmark("L1", 0.0, 0.0)])
    again = changed(2, [solved_landmark("L1", 0.0, 0.0, map_version=2)], first)
    assert (again.opened, again.closed) == ((), ())


def test_a_landmark_moved_by_the_least_bit_gets_a_new_row() -> None:
    first = changed(1, [solved_landmark("L1", 1.0, 0.0)])
    moved = changed(2, [solved_landmark("L1", math.nextafter(1.0, 2.0), 0.0, map_version=2)], first)
    assert ([row.valid_from_version for row in moved.opened], moved.closed) == ([2], ("L1",))


def test_a_landmark_no_longer_solved_is_closed() -> None:
    first = changed(1, [solved_landmark("L1", 0.0, 0.0), solved_landmark("L2", 9.0, 0.0)])
    gone = changed(2, [solved_landmark("L2", 9.0, 0.0, map_version=2)], first)
    assert (gone.opened, gone.closed, list(valid_with(first, gone))) == ((), ("L1",), ["L2"])


def test_a_trajectory_is_a_line_on_the_grid_with_its_length() -> None:
    (path,) = whole_change().trajectories
    assert path.path[0] == (ORIGIN.easting_m, ORIGIN.northing_m)
    assert (path.length_m, path.pose_count, path.last_stamp_ns - path.first_stamp_ns) == (20.0, 3, 2_000_000_000)
    assert json.loads(path.calibration_json) == [["speed_scale", 1.01, 0.001]]


def test_an_anchor_stands_where_its_label_is() -> None:
    tied, untied = whole_change().anchors
    assert (tied.lat_deg, tied.lon_deg, tied.image, tied.residual_m) == (-33.89, 151.19, "tile-1", 0.5)
    assert (untied.landmark, untied.reason, untied.residual_m) == ("", "no landmark within reach", None)


def test_an_anchor_whose_label_was_not_among_the_inputs_has_no_place() -> None:
    unknown = whole_change().anchors[1]
    assert (unknown.lat_deg, unknown.easting_m, unknown.sigma_m) == (None, None, None)


def test_a_label_mended_after_the_solve_says_nothing_about_it() -> None:
    labelled = [(LogPosition(LABEL_STREAM, n), label("anchor-1", lat_deg=-33.0 - n)) for n in range(3)]
    assert labels_within(labelled, [(LABEL_STREAM, 2)])["anchor-1", "tile-1"].lat_deg == -34.0
    assert labels_within(labelled, [("other", 2)]) == {}


def test_a_label_retracted_after_the_solve_still_belongs_to_it() -> None:
    retracted = AnchorRetracted(anchor="anchor-1", image="tile-1", author="surveyor", reason="moved")
    events: list[Corrected] = [label("anchor-1"), retracted]
    corrected = [(LogPosition(LABEL_STREAM, n), event) for n, event in enumerate(events)]
    assert list(labels_within(corrected, [(LABEL_STREAM, 1)])) == [("anchor-1", "tile-1")]
    assert labels_within(corrected, [(LABEL_STREAM, 2)]) == {}


def test_one_name_in_two_images_is_two_anchors() -> None:
    north = replace(label("anchor-1", lat_deg=-33.0), image="tile-2")
    labels = {("anchor-1", "tile-1"): label("anchor-1"), ("anchor-1", "tile-2"): north}
    events: list[Mapped] = [
        replace(associated("anchor-1", "L1"), image="tile-1"),
        replace(associated("anchor-1", "L1"), image="tile-2"),
        closing(1, 0),
    ]
    (version,) = solved_versions(logged(events))
    anchors = map_change(version, frame=frame(), labels=labels, valid={}).anchors
    assert [(row.image, row.lat_deg) for row in anchors] == [("tile-1", -33.89), ("tile-2", -33.0)]


def test_an_empty_map_has_no_rows() -> None:
    assert changed(1, []).opened == ()


def delta(map_version: int, landmarks: list[LandmarkSolved], *, removed: tuple[str, ...], held: MapChange) -> MapChange:
    """The change of a version that says only what differs from the one before."""
    head = replace(closing(map_version, 0), base_version=map_version - 1, removed=removed)
    events: list[Mapped] = [*landmarks, head]
    (version,) = solved_versions(logged(events))
    return map_change(version, frame=frame(), labels={}, valid=valid_with(held))


def test_a_version_that_says_what_changed_closes_and_opens_nothing_else() -> None:
    first = changed(1, [solved_landmark(f"L{n}", 9.0 * n, 0.0) for n in range(4)])
    second = delta(2, [solved_landmark("L1", 10.0, 0.0, map_version=2)], removed=("L3",), held=first)
    assert ([row.landmark for row in second.opened], second.closed) == (["L1"], ("L1", "L3"))
    assert list(valid_with(first, second)) == ["L0", "L2", "L1"]


def test_a_landmark_said_again_just_as_it_was_keeps_its_row() -> None:
    first = changed(1, [solved_landmark("L1", 1.0, 0.0)])
    second = delta(2, [solved_landmark("L1", 1.0, 0.0, map_version=2)], removed=(), held=first)
    assert (second.opened, second.closed) == ((), ())


def test_a_version_upon_another_says_what_saw_a_landmark_since() -> None:
    seen = replace(solved_landmark("L1", 1.0, 0.0), observations=(("veh-a", "boot-1", 3), ("veh-b", "boot-2", 1)))
    again = replace(solved_landmark("L1", 2.0, 0.0, map_version=2), observations=(("veh-a", "boot-1", 7),))
    (row,) = delta(2, [again], removed=(), held=changed(1, [seen])).opened
    assert row.provenance == '{"veh-a/boot-1": [7]}'


def test_a_landmark_nothing_saw_since_keeps_its_row_until_it_moves() -> None:
    first = changed(1, [replace(solved_landmark("L1", 1.0, 0.0), observations=(("veh-a", "boot-1", 3),))])
    still = replace(solved_landmark("L1", 1.0, 0.0, map_version=2), observations=())
    assert delta(2, [still], removed=(), held=first).opened == ()
    moved = replace(solved_landmark("L1", 1.5, 0.0, map_version=2), observations=())
    assert [row.provenance for row in delta(2, [moved], removed=(), held=first).opened] == ["{}"]


def test_a_landmark_that_others_saw_gets_a_row_of_its_own() -> None:
    first = changed(1, [replace(solved_landmark("L1", 1.0, 0.0), observations=(("veh-a", "boot-1", 3),))])
    again = replace(solved_landmark("L1", 1.0, 0.0, map_version=2), observations=(("veh-a", "boot-1", 4),))
    assert len(delta(2, [again], removed=(), held=first).opened) == 1


def test_what_is_held_of_a_landmark_does_not_grow_with_what_saw_it() -> None:
    many = replace(solved_landmark("L1", 1.0, 0.0), observations=tuple(("veh-a", "boot-1", n) for n in range(1000)))
    assert len(valid_with(changed(1, [many]))["L1"].provenance) <= HELD_LENGTH


def test_a_landmark_that_was_seen_often_keeps_its_row_where_nothing_changed() -> None:
    many = replace(solved_landmark("L1", 1.0, 0.0), observations=tuple(("veh-a", "boot-1", n) for n in range(1000)))
    again = delta(2, [replace(many, map_version=2)], removed=(), held=changed(1, [many]))
    assert (again.opened, again.closed) == ((), ())


def test_a_whole_version_says_everything_that_saw_a_landmark() -> None:
    seen = replace(solved_landmark("L1", 1.0, 0.0), observations=(("veh-a", "boot-1", 3),))
    again = replace(solved_landmark("L1", 2.0, 0.0, map_version=2), observations=(("veh-a", "boot-1", 7),))
    (version,) = solved_versions(logged([again, closing(2, 1)]))
    change = map_change(version, frame=frame(), labels={}, valid=valid_with(changed(1, [seen])))
    assert [row.provenance for row in change.opened] == ['{"veh-a/boot-1": [7]}']


def test_a_landmark_both_named_and_removed_is_removed() -> None:
    first = changed(1, [solved_landmark("L1", 1.0, 0.0)])
    second = delta(2, [solved_landmark("L1", 2.0, 0.0, map_version=2)], removed=("L1", "never there"), held=first)
    assert (second.opened, second.closed) == ((), ("L1",))


def test_what_a_label_would_tell_is_kept_of_landmarks_whose_terms_are_numbers() -> None:
    said = replace(label_gain(["L1", "L2"]), shared_m4=np.array([[np.nan, 0.0, 1.0], [0.5, 0.1, 0.25]]))
    (version,) = solved_versions(logged([said, closing(1, 0)]))
    (row,) = map_change(version, frame=frame(), labels={}, valid={}).label_gains
    assert json.loads(row.landmarks_json) == ["L2"]
    assert json.loads(row.terms_json) == [[0.04, 0.01, 0.09, 0.5, 0.1, 0.25]]


places_m = st.floats(-20_000.0, 20_000.0)
variances_m2 = st.floats(1e-6, 100.0)
any_sequence = st.integers(-(2**63), 2**63 - 1)  # what the wire can carry
any_observations = st.lists(st.tuples(st.text(max_size=3), st.just("boot-1"), any_sequence), max_size=3).map(tuple)


@st.composite
def any_landmark(draw: st.DrawFn) -> LandmarkSolved:
    """A landmark anywhere on the map, with any ellipse."""
    east_m2, north_m2 = draw(variances_m2), draw(variances_m2)
    shared_m2 = draw(st.floats(-0.99, 0.99)) * math.sqrt(east_m2 * north_m2)
    return replace(
        solved_landmark(draw(st.text(max_size=4)), draw(places_m), draw(places_m)),
        covariance_m2=np.array([[east_m2, shared_m2], [shared_m2, north_m2]]),
        anchors=draw(st.lists(st.text(max_size=3), max_size=2).map(tuple)),
        observations=draw(any_observations),
    )


@settings(max_examples=50, deadline=None)
@given(st.lists(any_landmark(), max_size=8))
def test_rows_made_side_by_side_are_those_made_one_by_one(events: list[LandmarkSolved]) -> None:
    one_by_one = [row for event in events for row in landmark_rows(in_columns([event]), frame())]
    assert landmark_rows(in_columns(events), frame()) == one_by_one
    assert [row.provenance for row in one_by_one] == [provenance_json(by_drive(event.observations)) for event in events]
