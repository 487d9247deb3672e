"""What a beam with a width hits, and what it says of that: silhouettes grow by half a beam to each side."""

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from trigpoint_vehicle.core.lidar.beams import shots_of
from trigpoint_vehicle.core.lidar.casting import Taken, World, cast_sweeps
from trigpoint_vehicle.core.lidar.hits import Hit, box_hit, cylinder_hit
from trigpoint_vehicle.core.lidar.scans import optics_of
from trigpoint_vehicle.core.lidar.solids import mover_states
from trigpoint_vehicle.core.scene.materials import REFLECTIVITY, Material, intensities, reflectivities
from vehicle_lidar.worlds import scanned

Floats = NDArray[np.float64]

BEAM_RAD = 0.003
RADIUS_M, HEIGHT_M = 0.1, 6.0
AWAY_M = 20.0  # a beam is 60 mm wide there
ASIDE_RAD = np.linspace(-0.01, 0.01, 4001)  # 5 microradians apart
STEP_RAD = 5e-6
TOUCHING_RAD = math.asin(RADIUS_M / AWAY_M)  # between a cylinder's middle and the line of sight that touches it


def at_pole(aside_rad: float, *, beam_rad: float = BEAM_RAD, away_m: float = AWAY_M, radius_m: float = RADIUS_M) -> Hit:
    """What a level beam, aimed so far to the left of a pole's axis, says of it."""
    ray = (0.0, 0.0, 2.0, math.cos(aside_rad), math.sin(aside_rad), 0.0)
    return cylinder_hit(ray, (away_m, 0.0, 0.0), radius_m, HEIGHT_M, beam_rad)


def at_wall(aside_rad: float, *, beam_rad: float = BEAM_RAD) -> Hit:
    """What a level beam says of a wall 10 m wide and 1 m thick seen straight, aimed so far to the left of its edge."""
    ray = (0.0, 0.0, 2.0, math.cos(aside_rad), math.sin(aside_rad), 0.0)
    return box_hit(ray, (AWAY_M + 0.5, -5.0, 0.0), (1.0, 0.0), (0.5, 5.0, HEIGHT_M), beam_rad)


def echoes(aside_rad: float) -> tuple[float, float, float]:
    """The same of a pole as `at_pole` says, by thin rays side by side: mean range by return, return, share hit."""
    lines = [at_pole(aside_rad + off, beam_rad=0.0) for off in np.linspace(-0.5, 0.5, 2001) * BEAM_RAD]
    range_m, returned, share = np.array([line for line in lines if line[2] > 0.0]).T
    return float(range_m @ returned / returned.sum()), float(returned.sum()) / 2001, float(share.sum()) / 2001


def width_rad(beam_rad: float) -> float:
    """How wide a pole is by the beams that hit it."""
    return STEP_RAD * sum(at_pole(float(aside), beam_rad=beam_rad)[2] > 0.0 for aside in ASIDE_RAD)


def test_a_pole_is_wider_by_a_beam_than_by_rays() -> None:
    assert width_rad(0.0) == pytest.approx(2.0 * TOUCHING_RAD, abs=2 * STEP_RAD)
    assert width_rad(BEAM_RAD) - width_rad(0.0) == pytest.approx(BEAM_RAD, abs=2 * STEP_RAD)


def test_a_beam_beside_a_pole_by_over_half_its_width_misses_it() -> None:
    edge_rad = TOUCHING_RAD + 0.5 * BEAM_RAD
    assert at_pole(edge_rad + 1e-5)[0] == math.inf
    assert at_pole(edge_rad - 1e-5)[2] > 0.0
    assert at_pole(-edge_rad - 1e-5)[0] == math.inf


def test_a_ray_at_the_middle_has_the_front_s_range() -> None:
    assert at_pole(0.0, beam_rad=0.0) == pytest.approx((AWAY_M - RADIUS_M, 1.0, 1.0), abs=1e-9)


def test_a_beam_narrower_than_the_pole_has_the_front_s_range_at_the_middle() -> None:
    range_m, returned, share = at_pole(0.0, radius_m=0.35)
    assert share == 1.0
    # the front is 1.3 mm deep under half a beam, and the mean of a parabola a third of that
    assert range_m == pytest.approx(AWAY_M - 0.35, abs=5e-4)
    assert returned == pytest.approx(1.0, abs=2e-3)


def test_a_grazing_beam_has_the_silhouette_s_range() -> None:
    range_m, returned, share = at_pole(TOUCHING_RAD + 0.499 * BEAM_RAD)
    silhouette_m = math.sqrt(AWAY_M**2 - RADIUS_M**2)
    assert range_m == pytest.approx(silhouette_m, abs=0.005)  # m; lit 60 um deep, which is 3.5 mm of range
    assert share == pytest.approx(0.001, rel=0.05)
    assert returned < 0.05 * share


@pytest.mark.parametrize("aside_rad", [0.0, 0.002, 0.0045, 0.006])
def test_a_beam_says_the_mean_of_the_rays_it_is_made_of(aside_rad: float) -> None:
    # over the beam the way to the axis's plane changes by 0.2 mm, and 2001 rays count an edge to half of one
    assert at_pole(aside_rad) == pytest.approx(echoes(aside_rad), abs=5e-4)


def test_a_beam_wider_than_a_pole_says_how_much_of_it_returns() -> None:
    range_m, returned, share = at_pole(0.0, away_m=60.0, radius_m=0.05)
    assert share == pytest.approx(2 * 0.05 / (60.0 * BEAM_RAD), rel=1e-6)
    assert returned == pytest.approx(share * math.pi / 4.0, rel=1e-6)  # the mean cosine over a cylinder's width
    assert 60.0 - 0.05 < range_m < 60.0


def test_half_of_a_beam_at_a_wall_s_edge_is_stopped() -> None:
    assert at_wall(0.0) == pytest.approx((AWAY_M, 0.5, 0.5), abs=1e-3)
    assert at_wall(-BEAM_RAD)[2] == 1.0
    assert at_wall(0.49 * BEAM_RAD)[2] == pytest.approx(0.01, rel=0.01)


def test_a_beam_beside_a_wall_by_over_half_its_width_misses_it() -> None:
    assert at_wall(0.501 * BEAM_RAD)[0] == math.inf
    assert at_wall(1e-6, beam_rad=0.0)[0] == math.inf


def test_the_far_end_of_a_long_wall_is_widened_by_the_beam_there() -> None:
    # along x from 10 m to 50 m ahead, 4 m to the left: past its end by a part of a beam's 150 mm
    def past(off_m: float) -> Hit:
        angle = math.atan2(4.0, 50.0) - off_m / math.hypot(4.0, 50.0)
        ray = (0.0, 0.0, 2.0, math.cos(angle), math.sin(angle), 0.0)
        return box_hit(ray, (30.0, 4.5, 0.0), (1.0, 0.0), (20.0, 0.5, HEIGHT_M), BEAM_RAD)

    assert past(0.07)[2] == pytest.approx((0.075 - 0.07) / 0.15, rel=0.05)
    assert past(0.08)[0] == math.inf


SWEEPS = slice(150, 170)  # in the middle of the drive


def taken(*, beam_rad: float, pole_reflectivity: float = REFLECTIVITY[Material.POLE]) -> Taken:
    """Twenty sweeps without errors."""
    drive = scanned().scans[0]
    settings = replace(drive.settings, beam_divergence_rad=beam_rad)
    shots, begin_s, reflectivity = shots_of(settings), drive.begin_s()[SWEEPS], reflectivities()
    reflectivity[Material.POLE] = pole_reflectivity
    world = World(drive.scene.ground, drive.solids.solids, reflectivity, intensities())
    base, movers = (
        drive.base_poses(begin_s[:, None] + shots.column_s),
        mover_states(drive.scene, drive.session, begin_s),
    )
    return cast_sweeps(world, optics_of(settings, shots), base, movers, np.zeros(len(begin_s), dtype=np.uint64))


@pytest.fixture(scope="module")
def by_rays() -> Taken:
    return taken(beam_rad=0.0)


@pytest.fixture(scope="module")
def by_beams() -> Taken:
    return taken(beam_rad=BEAM_RAD)


def on_poles(sweeps: Taken) -> NDArray[np.bool_]:
    """Which shots came back from poles."""
    which: NDArray[np.bool_] = (sweeps.material == Material.POLE) & np.isfinite(sweeps.range_m)
    return which


def widening(by_rays: Taken, by_beams: Taken) -> float:
    """How much more often poles are hit by beams, over what beams all of which count as soon as they touch add."""
    hit = on_poles(by_rays)
    radius_m = scanned().scans[0].solids.solids.size[by_rays.solid[hit], 0]
    most = float((BEAM_RAD * by_rays.range_m[hit] / (2.0 * radius_m)).mean())
    assert hit.sum() > 1000
    return float(on_poles(by_beams).sum() / hit.sum() - 1.0) / most


def test_poles_are_widened_by_less_than_a_beam_before_what_returns_more(by_rays: Taken, by_beams: Taken) -> None:
    assert 0.4 < widening(by_rays, by_beams) < 0.9


def test_poles_that_outshine_everything_are_widened_by_a_beam(by_rays: Taken) -> None:
    # 10 % for what hides a pole's edge, or hides one pole behind another
    assert widening(by_rays, taken(beam_rad=BEAM_RAD, pole_reflectivity=1e6)) == pytest.approx(1.0, abs=0.1)


def test_what_is_behind_the_edges_of_black_poles_is_said(by_rays: Taken) -> None:
    black = taken(beam_rad=BEAM_RAD, pole_reflectivity=0.0)
    beyond = np.isfinite(black.range_m) & on_poles(by_rays)
    assert not on_poles(black).any()
    assert beyond.sum() > 100
    assert (black.range_m[beyond] > by_rays.range_m[beyond]).all()


def test_a_beam_loses_next_to_nothing_of_what_rays_see(by_rays: Taken, by_beams: Taken) -> None:
    seen, still = np.isfinite(by_rays.range_m), np.isfinite(by_beams.range_m)
    assert (seen & ~still).sum() < 1e-4 * seen.sum()
