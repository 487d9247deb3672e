"""What a log holds, folded into values."""

import pytest

from event_examples.rows import START_NS, imu_row
from landmark_maps.examples import append_mapped, label, solved_landmark, solved_map
from trigpoint.errors import InputError
from trigpoint.events.corrected import AnchorRetracted, Corrected, DriveExcluded, DriveIncluded
from trigpoint.events.envelope import Envelope, EventIdentity
from trigpoint.logs.memory_log import MemoryLog
from trigpoint.logs.readings import logged_anchors, logged_drives, logged_maps
from trigpoint_optimisation.resuming import needed_of, resumed


def _log_of(*corrections: Corrected) -> MemoryLog:
    log = MemoryLog()
    rows = [Envelope(EventIdentity("ingest", "boot-1", n), START_NS, event) for n, event in enumerate(corrections)]
    log.append("corrections", rows)
    return log


def _retracted(anchor: str) -> AnchorRetracted:
    return AnchorRetracted(anchor=anchor, image=label(anchor).image, author="surveyor", reason="moved")


def test_a_retracted_anchor_is_in_force_no_more() -> None:
    log = _log_of(label("a"), label("b"), _retracted("a"))
    assert logged_anchors(log) == (label("b"),)


def test_an_anchor_labelled_again_after_its_retraction_is_in_force() -> None:
    log = _log_of(label("a"), _retracted("a"), label("a"))
    assert logged_anchors(log) == (label("a"),)


def _excluded(boot_id: str) -> DriveExcluded:
    return DriveExcluded(vehicle="van", boot_id=boot_id, author="operator", reason="antenna came loose")


def _two_drives(*corrections: Corrected) -> MemoryLog:
    log = _log_of(*corrections)
    log.append("veh-van", [imu_row(0), imu_row(0, boot_id="boot-2"), imu_row(1)])
    return log


def test_an_excluded_drive_is_left_out_and_the_other_is_whole() -> None:
    (drive,) = logged_drives(_two_drives(_excluded("boot-2")))
    assert (drive.boot_id, len(drive.imu.stamp_ns)) == ("boot-1", 2)


def test_a_drive_included_again_takes_part() -> None:
    included = DriveIncluded(vehicle="van", boot_id="boot-2", author="operator", reason="it had not")
    drives = logged_drives(_two_drives(_excluded("boot-2"), included))
    assert [drive.boot_id for drive in drives] == ["boot-1", "boot-2"]


def test_where_every_drive_is_excluded_it_is_said_how_many() -> None:
    log = _two_drives(_excluded("boot-1"), _excluded("boot-2"))
    with pytest.raises(InputError, match="all of the log's 2 drives are excluded"):
        logged_drives(log)


def test_what_a_solve_left_that_was_cut_off_is_in_no_map_version() -> None:
    log = MemoryLog()
    append_mapped(log, solved_map(1, [solved_landmark("L1", 1.0, 0.0)]))
    cut_off = solved_map(2, [solved_landmark(name, 2.0, 0.0, map_version=2) for name in ("L1", "ghost")])
    append_mapped(log, cut_off[:3], boot_id="killed")
    append_mapped(log, solved_map(2, [solved_landmark("L1", 3.0, 0.0, map_version=2)]), boot_id="boot-2")
    _, newest = logged_maps(log)
    assert [(one.landmark, one.position_m[0]) for one in newest.landmarks] == [("L1", 3.0)]
    assert list(resumed(log).landmarks) == [needed_of(one) for one in newest.landmarks]
