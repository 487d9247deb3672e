"""A small world solved from end to end: one block, two vehicles, forty-one poles, two aerial images."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from solved_worlds.examples import CENTRE_M, FRAME, Lap, World, labelled, mismatched, world
from trigpoint.anchoring.association import Assignment
from trigpoint.anchoring.labels import labels_of
from trigpoint.events.corrected import AnchorLabelled
from trigpoint.events.estimated import FixJudged
from trigpoint_optimisation.core.fleet import solved_state
from trigpoint_optimisation.core.solve import Solution, solve_map, usable_fixes
from trigpoint_optimisation.core.stages import Solved, anchored, full_graph, in_silence, solve_fleet
from trigpoint_optimisation.core.state import MapState
from trigpoint_optimisation.settings import OdometrySettings, SolveSettings

Floats = NDArray[np.float64]

SETTINGS = SolveSettings(method="loose", edges="honest", odometry=OdometrySettings(keyframe_m=4.0))  # coarse: quick
BOTH = (Lap(), Lap(vehicle="van", begin_rad=3.5, seed=2, duration_s=50.0))
SHORT = Lap(duration_s=40.0)


@pytest.fixture(scope="module")
def block() -> World:
    return world(*BOTH)


@pytest.fixture(scope="module")
def loose(block: World) -> Solved:
    return solve_fleet(block.drives, [], FRAME, SETTINGS)


def with_labels(loose: Solved, anchors: Sequence[AnchorLabelled], *, image_offsets: bool = True) -> Solved:
    return anchored(loose, labels_of(anchors, FRAME, image_offsets=image_offsets), progress=in_silence)


@pytest.fixture(scope="module")
def tied(block: World, loose: Solved) -> Solved:
    return with_labels(loose, block.anchors)


def poles_met(landmark_m: Floats, pole_m: Floats) -> list[int]:
    """The pole nearest to each landmark, after the map's common shift is taken off."""
    centred = landmark_m - landmark_m.mean(axis=0) + pole_m.mean(axis=0)
    return [int(row.argmin()) for row in np.hypot(*(centred[:, None] - pole_m[None]).transpose(2, 0, 1))]


def errors_m(state: MapState, block: World) -> Floats:
    """Landmark minus its pole (l, 2)."""
    error: Floats = state.landmark_m - block.pole_m[poles_met(state.landmark_m, block.pole_m)]
    return error


def mean_error_m(solved: Solved, block: World) -> float:
    return float(np.hypot(*errors_m(solved.state, block).T).mean())


def test_every_pole_becomes_one_landmark_even_in_a_pair(loose: Solved, block: World) -> None:
    met = poles_met(loose.state.landmark_m, block.pole_m)
    assert sorted(met) == list(range(len(block.pole_m)))


def test_a_map_off_by_its_fixes_is_labelled_without_one_mistake(tied: Solved, loose: Solved, block: World) -> None:
    assert mean_error_m(loose, block) > 1.5  # m: what the fixes' slow error leaves; poles are 3.5 m apart and less
    met = np.array(poles_met(tied.state.landmark_m, block.pole_m))
    assert met[tied.assignment.landmark].tolist() == list(range(len(block.pole_m)))


def test_anchors_take_the_map_to_their_own_accuracy(tied: Solved, block: World) -> None:
    # m: labels of 0.1 m an axis and two images whose mean offset of 0.07 m cannot be seen
    assert mean_error_m(tied, block) < 0.15


def test_offsets_of_images_are_found_against_one_another(tied: Solved) -> None:
    # The common part is unobservable; their difference is known as well as the map's own shape.
    difference = tied.state.image_m[0] - tied.state.image_m[1]
    np.testing.assert_allclose(difference, (0.5, -0.3), atol=0.1)  # m: 20 labels of 0.1 m in each


def bend_m(solved: Solved, block: World) -> float:
    """How far the eastern landmarks are out of shape, mean in m: their common shift is taken off."""
    error = errors_m(solved.state, block)
    error = error[solved.state.landmark_m[:, 0] > CENTRE_M[0] + 20.0]
    return float(np.hypot(*(error - error.mean(axis=0)).T).mean())


def test_one_images_shifted_labels_do_not_bend_anothers(tied: Solved, loose: Solved, block: World) -> None:
    moved = labelled(block.pole_m, shift_m=np.array([[0.3, -0.1], [-0.2, 1.2]]))  # the west a metre further north
    with_offsets = bend_m(with_labels(loose, moved), block)
    assert with_offsets == pytest.approx(bend_m(tied, block), abs=0.005)  # m, where Gauss-Newton stopped
    assert bend_m(with_labels(loose, moved, image_offsets=False), block) > 3.0 * with_offsets


@pytest.mark.parametrize("seed", [4, 5])
def test_three_wrong_labels_in_ten_cost_a_tenth_at_most(block: World, loose: Solved, seed: int) -> None:
    wrong = mismatched(block, 0.3, seed=seed)
    clean = [own for own, given in zip(block.anchors, wrong, strict=True) if own == given]
    error_m = mean_error_m(with_labels(loose, wrong), block)
    assert error_m < 1.1 * mean_error_m(with_labels(loose, clean), block)


def test_a_wrong_label_is_reported_with_the_reason(block: World, loose: Solved) -> None:
    wrong = mismatched(block, 0.3)
    assignment = with_labels(loose, wrong).assignment
    moved = np.array([own != given for own, given in zip(block.anchors, wrong, strict=True)])
    assert (assignment.landmark[moved] == -1).mean() > 0.9
    assert all(assignment.reason[row] != "mutually nearest" for row in np.nonzero(assignment.landmark < 0)[0])


def test_one_strong_anchor_at_least_halves_its_landmarks_error(block: World, loose: Solved) -> None:
    met = poles_met(loose.state.landmark_m, block.pole_m)
    labels = labels_of([replace(block.anchors[met[0]], image_sigma_m=0.0)], FRAME, image_offsets=True)
    one = replace(loose, labels=labels, assignment=Assignment(landmark=np.array([0]), reason=("given",)))
    after = solved_state(full_graph(one), one.state)
    before_m = np.hypot(*errors_m(loose.state, block)[0])
    assert np.hypot(*errors_m(after, block)[0]) < 0.5 * before_m


def test_landmark_errors_are_as_large_as_their_covariances_say(tied: Solved, block: World) -> None:
    error = errors_m(tied.state, block).ravel()
    nees = error @ np.linalg.solve(Solution(solved=tied).landmark_covariance_m2, error) / len(error)
    assert 0.4 < nees < 1.6  # 82 degrees of freedom: 1 with a sigma of 0.16, and noise measured, not given


def test_the_loose_map_knows_how_little_it_knows(loose: Solved, block: World) -> None:
    sigma_m = np.sqrt(np.trace(Solution(solved=loose).landmark_covariance_m2) / 41.0)
    assert mean_error_m(loose, block) / 3.0 < sigma_m < 3.0 * mean_error_m(loose, block)


def test_calibrations_are_found(tied: Solved) -> None:
    speed_scale, bias_radps = tied.state.drives[0].scale[0], tied.state.drives[0].turn_bias.mean()
    assert speed_scale == pytest.approx(1.01 * FRAME.point_scale, abs=0.001)  # 0.1 %: 0.6 m in 600 m
    assert bias_radps == pytest.approx(0.002, abs=0.0003)  # rad/s: 0.03 rad in 110 s


def test_the_map_as_events_names_every_landmark_and_label_once(tied: Solved, block: World) -> None:
    solved_map = Solution(solved=tied).map
    names = [landmark.landmark for landmark in solved_map.landmarks]
    assert len(set(names)) == len(names) == solved_map.head.landmark_count == 41
    assert [anchor.anchor for anchor in solved_map.anchors] == [anchor.anchor for anchor in block.anchors]
    assert {anchor.landmark for anchor in solved_map.anchors} == set(names)


def test_landmarks_say_who_saw_them_and_when(tied: Solved) -> None:
    landmarks = Solution(solved=tied).map.landmarks
    assert {landmark.vehicles for landmark in landmarks} <= {("car",), ("van",), ("car", "van")}
    assert any(landmark.vehicles == ("car", "van") for landmark in landmarks)
    assert all(landmark.first_seen_ns < landmark.last_seen_ns for landmark in landmarks)


def test_the_label_reduction_solves_to_the_same_landmarks(tied: Solved) -> None:
    # Labels added to the reduction in one dense step end where the full graph ended: its step is zero there.
    part = Solution(solved=tied).reduction()
    sizes = 2 * len(part.landmarks), 2 * len(part.images)
    information, gradient = np.zeros((sum(sizes), sum(sizes))), np.zeros(sum(sizes))
    information[: sizes[0], : sizes[0]], gradient[: sizes[0]] = part.information, part.gradient
    offset = tied.state.image_m.ravel()
    weight = 1.0 / np.repeat(part.image_sigma_m, 2) ** 2
    information[sizes[0] :, sizes[0] :] += np.diag(weight)
    gradient[sizes[0] :] -= weight * offset
    for row, landmark in enumerate(part.landmark_index):
        pick = np.zeros((2, sum(sizes)))
        pick[:, 2 * landmark : 2 * landmark + 2] = np.eye(2)
        image = sizes[0] + 2 * part.image_index[row]
        pick[:, image : image + 2] = np.eye(2)
        residual = part.label_m[row] - part.point_m[landmark] - tied.state.image_m[part.image_index[row]]
        information += pick.T @ pick / part.sigma_m[row] ** 2
        gradient += pick.T @ residual / part.sigma_m[row] ** 2
    assert np.abs(np.linalg.solve(information, gradient)).max() < 0.02  # m: where Gauss-Newton stopped


def test_the_stages_come_in_their_order() -> None:
    said: list[str] = []
    small = world(SHORT)
    solve_map(
        small.drives,
        small.anchors,
        FRAME,
        replace(SETTINGS, method="anchored"),
        progress=lambda stage, _: said.append(stage),
    )
    assert list(dict.fromkeys(said)) == ["odometry and fixes", "landmarks", "anchors"]


def test_the_same_drives_give_the_same_bytes() -> None:
    small = world(SHORT)
    maps = [solve_map(small.drives, [], FRAME, SETTINGS).map for _ in range(2)]
    assert repr(maps[0]) == repr(maps[1])
    assert [path.pose.tobytes() for path in maps[0].trajectories] == [
        path.pose.tobytes() for path in maps[1].trajectories
    ]


def test_a_fix_the_filter_contradicts_has_no_say() -> None:
    verdicts = [judged(sequence, accepted=sequence % 10 != 0) for sequence in range(40)]
    assert usable_fixes(world(SHORT).drives[0], verdicts).tolist() == [sequence % 10 != 0 for sequence in range(40)]


def test_a_filter_that_rejects_nearly_everything_lost_its_way() -> None:
    verdicts = [judged(sequence, accepted=sequence % 10 == 0) for sequence in range(40)]
    assert usable_fixes(world(SHORT).drives[0], verdicts).all()


def test_another_drives_verdicts_do_not_count() -> None:
    small = world(SHORT)
    verdicts = [judged(sequence, accepted=False, boot_id="other") for sequence in range(40)]
    assert usable_fixes(small.drives[0], verdicts).all()


def test_a_fix_the_filter_only_waited_out_is_left_to_the_solve() -> None:
    verdicts = [judged(sequence, accepted=sequence > 5, rejected_for="outage") for sequence in range(40)]
    assert usable_fixes(world(SHORT).drives[0], verdicts).all()


def judged(sequence: int, *, accepted: bool, boot_id: str = "boot", rejected_for: str = "outside gate") -> FixJudged:
    return FixJudged(
        vehicle="car",
        boot_id=boot_id,
        fix_sequence=sequence,
        accepted=accepted,
        reason="inside gate" if accepted else rejected_for,
        nis=1.0,
        limit=5.99,
        innovation_x_m=0.0,
        innovation_y_m=0.0,
    )
