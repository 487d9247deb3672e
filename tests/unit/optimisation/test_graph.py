"""What the graph is made of: every edge where it belongs, each as strong as it says."""

import math
from dataclasses import replace

import gtsam
import numpy as np
import pytest
from numpy.typing import NDArray

from driven_paths.examples import ANTENNA_M, FRAME, Course, driven
from trigpoint_optimisation.core.graph import (
    TiedLabels,
    add_fix_bias,
    add_fixes,
    add_labels,
    add_sightings,
    chosen_fixes,
    fix_bias_stamps,
    fleet_graph,
    with_kernel,
)
from trigpoint_optimisation.core.odometry import relative_poses
from trigpoint_optimisation.core.preparation import PreparedDrive, nominal_calibration, prepared_drive
from trigpoint_optimisation.core.sightings import Sightings
from trigpoint_optimisation.core.state import (
    DriveState,
    MapState,
    fix_bias_key,
    image_key,
    landmark_key,
    pose_key,
    shared_keys,
    state_of,
    values_of,
)
from trigpoint_optimisation.settings import (
    HONEST_EDGES,
    PAPER_EDGES,
    FixSettings,
    Kernel,
    OdometrySettings,
    SolveSettings,
)

Floats = NDArray[np.float64]

SETTINGS = SolveSettings(odometry=OdometrySettings(keyframe_m=6.0))
WORLD = driven(Course(duration_s=60.0, white_m=1e-9))


@pytest.fixture(scope="module")
def prepared() -> PreparedDrive:
    calibration = nominal_calibration(WORLD.drive, SETTINGS.calibration, point_scale=FRAME.point_scale)
    return prepared_drive(WORLD.drive, FRAME, SETTINGS, index=0, calibration=calibration)


def truth(prepared: PreparedDrive, fixes: FixSettings = PAPER_EDGES) -> MapState:
    drive = DriveState(
        pose=WORLD.pose_at(prepared.stamp_ns),
        scale=np.array([FRAME.point_scale, 1.0, 0.0]),
        turn_bias=np.zeros(len(prepared.calibration.turn_bias)),
        antenna_m=FRAME.point_scale * ANTENNA_M,
        fix_bias_m=np.zeros((len(fix_bias_stamps(prepared, fixes)), 2)),
        sensor=np.zeros(6),
    )
    return MapState(drives=(drive,), landmark_m=np.zeros((0, 2)), image_m=np.zeros((0, 2)))


def fixes_cost(prepared: PreparedDrive, fixes: FixSettings, *, shift_m: Floats, robust: bool = False) -> float:
    """The cost of a fix graph when all keyframes are shifted from the truth."""
    state, graph = truth(prepared, fixes), gtsam.NonlinearFactorGraph()
    moved = replace(state.drives[0], pose=state.drives[0].pose + np.array([*shift_m, 0.0]))
    rows = chosen_fixes(prepared, np.ones(60, dtype=bool), spacing_m=fixes.spacing_m)
    add_fixes(graph, prepared, rows, fixes=fixes, robust=robust)
    return float(graph.error(values_of(replace(state, drives=(moved,)))))


def test_the_papers_edges_stand_every_ten_metres_of_path(prepared: PreparedDrive) -> None:
    rows = chosen_fixes(prepared, np.ones(60, dtype=bool), spacing_m=10.0)
    cells = np.floor(prepared.fix_path_m[rows] / 10.0)
    assert cells.tolist() == list(range(36))  # 60 s at 6 m/s


def test_a_fix_that_is_not_allowed_is_not_chosen(prepared: PreparedDrive) -> None:
    allowed = np.arange(60) % 2 == 0
    assert allowed[chosen_fixes(prepared, allowed, spacing_m=2.0)].all()


def test_a_standing_vehicles_fixes_count_once() -> None:
    standing = driven(Course(duration_s=60.0, speed_mps=0.0))
    calibration = nominal_calibration(standing.drive, SETTINGS.calibration, point_scale=FRAME.point_scale)
    ready = prepared_drive(standing.drive, FRAME, SETTINGS, index=0, calibration=calibration)
    assert len(chosen_fixes(ready, np.ones(60, dtype=bool), spacing_m=2.0)) == 1


def test_the_truth_costs_a_graph_of_true_fixes_nothing(prepared: PreparedDrive) -> None:
    assert fixes_cost(prepared, PAPER_EDGES, shift_m=np.zeros(2)) < 1e-3  # 36 edges off by 0.03 m of 5 m


def test_every_fix_pulls_as_its_sigma_says(prepared: PreparedDrive) -> None:
    # 36 edges of 5 m, all off by 5 m: half a unit each.
    assert fixes_cost(prepared, PAPER_EDGES, shift_m=np.array([3.0, 4.0])) == pytest.approx(18.0, rel=0.01)


def test_doubling_sigma_quarters_the_cost(prepared: PreparedDrive) -> None:
    once = fixes_cost(prepared, PAPER_EDGES, shift_m=np.array([3.0, 4.0]))
    twice = fixes_cost(prepared, replace(PAPER_EDGES, sigma_m=10.0), shift_m=np.array([3.0, 4.0]))
    assert twice == pytest.approx(once / 4.0)


def test_only_the_robust_graph_lets_wild_fixes_pull_less(prepared: PreparedDrive) -> None:
    far = np.array([500.0, 0.0])
    plain, robust = (fixes_cost(prepared, PAPER_EDGES, shift_m=far, robust=robust) for robust in (False, True))
    assert robust < 0.01 * plain


def test_a_hundred_fixes_do_not_claim_what_their_slow_error_hides(prepared: PreparedDrive) -> None:
    def sigma_m(fixes: FixSettings) -> float:
        graph, state = (
            fleet_graph([prepared], SETTINGS.calibration, point_scale=FRAME.point_scale),
            truth(prepared, fixes),
        )
        rows = chosen_fixes(prepared, np.ones(60, dtype=bool), spacing_m=fixes.spacing_m)
        add_fixes(graph, prepared, rows, fixes=fixes, robust=False)
        return float(np.sqrt(gtsam.Marginals(graph, values_of(state)).marginalCovariance(pose_key(0, 30))[0, 0]))

    white = replace(HONEST_EDGES, bias_sigma_m=0.0)
    assert sigma_m(white) < 0.5  # m: 1.5 m over the square root of 60 fixes, and heading
    assert sigma_m(HONEST_EDGES) > 0.8 * HONEST_EDGES.bias_sigma_m


def test_knots_of_the_slow_error_cover_every_fix(prepared: PreparedDrive) -> None:
    knots = fix_bias_stamps(prepared, replace(HONEST_EDGES, bias_time_s=30.0))
    assert np.diff(knots).tolist() == [10_000_000_000] * (len(knots) - 1)
    assert knots[0] <= WORLD.drive.fixes.stamp_ns[0]
    assert knots[-1] > WORLD.drive.fixes.stamp_ns[-1]


def test_the_slow_error_is_as_large_at_every_knot() -> None:
    graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
    add_fix_bias(graph, 0, np.arange(5, dtype=np.int64) * 100_000_000_000, HONEST_EDGES)
    for knot in range(5):
        values.insert(fix_bias_key(0, knot), np.zeros(2))
    last = gtsam.Marginals(graph, values).marginalCovariance(fix_bias_key(0, 4))
    np.testing.assert_allclose(last, HONEST_EDGES.bias_sigma_m**2 * np.eye(2), rtol=1e-9)  # rounding


def test_a_slow_error_that_grows_evenly_is_taken_evenly_between_its_knots(prepared: PreparedDrive) -> None:
    fixes = replace(HONEST_EDGES, bias_time_s=30.0)  # a knot every 10 s
    state, graph = truth(prepared, fixes), gtsam.NonlinearFactorGraph()
    rows = chosen_fixes(prepared, np.ones(60, dtype=bool), spacing_m=6.0)
    add_fixes(graph, prepared, rows, fixes=fixes, robust=False)
    grown = np.arange(len(state.drives[0].fix_bias_m)) * np.array([[10.0], [0.0]])
    values = values_of(replace(state, drives=(replace(state.drives[0], fix_bias_m=grown.T),)))
    edges = [graph.at(index) for index in range(graph.size() - len(rows), graph.size())]
    east_m = [edge.unwhitenedError(values)[0] for edge in edges if isinstance(edge, gtsam.NoiseModelFactor)]
    after_s = (WORLD.drive.fixes.stamp_ns[rows] - WORLD.drive.fixes.stamp_ns[0]) * 1e-9
    np.testing.assert_allclose(east_m, after_s, atol=0.05)  # m: metre a second; the drive's own truth is good to 0.03


def test_a_lever_arm_is_held_where_it_was_described(prepared: PreparedDrive) -> None:
    graph, state = fleet_graph([prepared], SETTINGS.calibration, point_scale=FRAME.point_scale), truth(prepared)
    arm_m = state.drives[0].antenna_m + (SETTINGS.calibration.antenna_m, 0.0)
    moved = replace(state, drives=(replace(state.drives[0], antenna_m=arm_m),))
    assert graph.error(values_of(moved)) - graph.error(values_of(state)) == pytest.approx(0.5)  # one sigma


def test_odometry_at_the_truth_costs_nothing(prepared: PreparedDrive) -> None:
    graph = fleet_graph([prepared], SETTINGS.calibration, point_scale=FRAME.point_scale)
    assert graph.error(values_of(truth(prepared))) / len(prepared.stamp_ns) < 1.0  # half a unit each would be noise


def test_one_keyframe_out_of_place_is_felt_by_odometry(prepared: PreparedDrive) -> None:
    graph, state = fleet_graph([prepared], SETTINGS.calibration, point_scale=FRAME.point_scale), truth(prepared)
    pose = state.drives[0].pose.copy()
    pose[20, :2] += 1.0
    moved = replace(state, drives=(replace(state.drives[0], pose=pose),))
    assert graph.error(values_of(moved)) > graph.error(values_of(state)) + 100.0  # over ten sigma


def sighted(point_m: Floats, *, sigma_m: float) -> Sightings:
    return Sightings(
        drive=np.zeros(1, dtype=np.int64),
        keyframe=np.zeros(1, dtype=np.int64),
        track=np.zeros(1, dtype=np.int64),
        point_m=point_m[None, :],
        covariance=sigma_m**2 * np.eye(2)[None],
        shared_m2=np.zeros(1),
        by_offset=np.zeros((1, 2, 2)),
    )


def landmark_covariance(point_m: Floats, *, sigma_m: float) -> Floats:
    """Of a landmark seen once from a keyframe that is known, heading 1 rad."""
    graph, values, pose = gtsam.NonlinearFactorGraph(), gtsam.Values(), gtsam.Pose2(10.0, 20.0, 1.0)
    values.insert(pose_key(0, 0), pose)
    values.insert(landmark_key(0), pose.transformFrom(point_m))
    graph.add(gtsam.PriorFactorPose2(pose_key(0, 0), pose, gtsam.noiseModel.Isotropic.Sigma(3, 1e-6)))
    add_sightings(graph, sighted(point_m, sigma_m=sigma_m), np.zeros(1, dtype=np.int64), kernel=None)
    covariance: Floats = gtsam.Marginals(graph, values).marginalCovariance(landmark_key(0))
    return covariance


@pytest.mark.parametrize("point_m", [(20.0, 0.0), (-7.0, 12.0), (0.5, -0.4)])
def test_a_sighting_is_as_strong_in_metres_at_any_range(point_m: tuple[float, float]) -> None:
    covariance = landmark_covariance(np.array(point_m), sigma_m=0.2)
    np.testing.assert_allclose(covariance, 0.04 * np.eye(2), atol=1e-6)  # m^2: the pose is known to a micrometre


def test_a_sighting_of_no_landmark_and_one_at_the_bases_origin_are_left_out() -> None:
    graph = gtsam.NonlinearFactorGraph()
    add_sightings(graph, sighted(np.array([5.0, 0.0]), sigma_m=0.1), np.full(1, -1), kernel=None)
    add_sightings(graph, sighted(np.array([0.1, 0.0]), sigma_m=0.1), np.zeros(1, dtype=np.int64), kernel=None)
    assert graph.size() == 0


def test_a_label_in_an_image_is_as_sure_as_both_together() -> None:
    graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
    labels = TiedLabels(
        landmark=np.array([0]),
        label_m=np.zeros((1, 2)),
        sigma_m=np.array([0.1]),
        image=np.array([0]),
        image_sigma_m=np.array([0.35]),
    )
    add_labels(graph, labels)
    values.insert(landmark_key(0), np.zeros(2))
    values.insert(image_key(0), np.zeros(2))
    covariance = gtsam.Marginals(graph, values).marginalCovariance(landmark_key(0))
    np.testing.assert_allclose(np.sqrt(np.diag(covariance)), math.hypot(0.1, 0.35), rtol=1e-9)  # rounding


def test_no_kernel_is_the_noise_itself() -> None:
    noise = gtsam.noiseModel.Unit.Create(2)
    assert with_kernel(noise, None) is noise


def test_dynamic_covariance_scaling_leaves_residuals_within_its_sigmas_alone_and_cauchy_does_not() -> None:
    within = 2.5**2  # squared, in sigmas; a plain loss is half of it
    unit = gtsam.noiseModel.Unit.Create(2)
    assert with_kernel(unit, Kernel("dcs", 3.0)).loss(within) == within / 2.0
    assert with_kernel(unit, Kernel("cauchy", 3.0)).loss(within) < within / 2.0


def test_dynamic_covariance_scaling_bounds_what_a_wrong_sighting_costs() -> None:
    scaled = with_kernel(gtsam.noiseModel.Unit.Create(2), Kernel("dcs", 3.0))
    assert scaled.loss(50.0**2) < scaled.loss(500.0**2) < 1.5 * 3.0**2  # its limit


def test_a_state_comes_back_from_its_values_unchanged(prepared: PreparedDrive) -> None:
    state = replace(truth(prepared, HONEST_EDGES), landmark_m=np.array([[1.0, 2.0]]), image_m=np.array([[0.1, 0.2]]))
    back = state_of(values_of(state), state)
    turned = relative_poses(state.drives[0].pose, back.drives[0].pose)
    np.testing.assert_allclose(turned, 0.0, atol=1e-9)  # m and rad, rounding
    assert back.landmark_m.tolist() == state.landmark_m.tolist()
    assert back.image_m.tolist() == state.image_m.tolist()
    assert back.drives[0].scale.tolist() == state.drives[0].scale.tolist()


def test_poses_and_landmarks_are_not_shared_and_calibrations_are(prepared: PreparedDrive) -> None:
    state = replace(truth(prepared), landmark_m=np.zeros((3, 2)), image_m=np.zeros((2, 2)))
    shared = set(shared_keys(values_of(state)))
    assert {image_key(0), image_key(1)} < shared
    assert not shared & {pose_key(0, 0), landmark_key(0)}
