"""What one more label would tell, foretold and then solved for: the landmarks' summed variance before and after."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from solved_worlds.examples import FRAME, Lap, World, world
from trigpoint.anchoring.gain import variance_reductions_m2
from trigpoint.anchoring.labels import labels_of
from trigpoint.events.corrected import AnchorLabelled
from trigpoint.events.mapped import LabelGainSolved
from trigpoint.geodesy.projection import wgs84_from_map_points
from trigpoint_optimisation.core.solve import Solution
from trigpoint_optimisation.core.stages import Solved, anchored, in_silence, solve_fleet
from trigpoint_optimisation.settings import OdometrySettings, SolveSettings

Floats = NDArray[np.float64]

SETTINGS = SolveSettings(method="loose", edges="honest", odometry=OdometrySettings(keyframe_m=4.0))
SIGMA_M = 0.1


@pytest.fixture(scope="module")
def block() -> World:
    return world(Lap(), Lap(vehicle="van", begin_rad=3.5, seed=2, duration_s=50.0))


@pytest.fixture(scope="module")
def loose(block: World) -> Solved:
    return solve_fleet(block.drives, [], FRAME, SETTINGS)


@pytest.fixture(scope="module")
def held(block: World, loose: Solved) -> Solution:
    """The map held by labels on every second pole of the east alone: the west is known much worse."""
    return solved_with(loose, labels_in_force(block))


def labels_in_force(block: World) -> tuple[AnchorLabelled, ...]:
    return tuple(one for one in block.anchors if one.image == "east")[::2]


def solved_with(loose: Solved, anchors: tuple[AnchorLabelled, ...]) -> Solution:
    return Solution(solved=anchored(loose, labels_of(anchors, FRAME, image_offsets=True), progress=in_silence))


def gain_of(held: Solution, image: str) -> LabelGainSolved:
    (found,) = [gain for gain in held.map.gains if gain.image == image]
    return found


def least_known(held: Solution) -> int:
    return int(np.diag(held.landmark_covariance_m2).reshape(-1, 2).sum(axis=1).argmax())


def one_more(block: World, held: Solution, *, image: str, image_sigma_m: float) -> AnchorLabelled:
    """A label of the least known landmark, just where the map expects one."""
    images = held.solved.labels.images
    offset_m = held.solved.state.image_m[images.index(image)] if image in images else np.zeros(2)
    place_m = held.solved.state.landmark_m[least_known(held)] + offset_m
    lat_deg, lon_deg = wgs84_from_map_points(place_m[None, :], FRAME)
    changed = {"lat_deg": float(lat_deg[0]), "lon_deg": float(lon_deg[0]), "sigma_m": SIGMA_M}
    named = replace(block.anchors[0], anchor="one-more", image=image, image_sigma_m=image_sigma_m)
    return replace(named, **changed)  # type: ignore[arg-type]


def summed_variance_m2(solution: Solution) -> float:
    return float(np.trace(solution.landmark_covariance_m2))


@pytest.mark.parametrize(("image", "image_sigma_m"), [("east", 0.35), ("", 0.0), ("new", 0.35)])
def test_what_a_label_would_tell_is_what_the_next_solve_finds(
    block: World, loose: Solved, held: Solution, image: str, image_sigma_m: float
) -> None:
    gain = gain_of(held, image if image == "east" else "")
    sigma_m = SIGMA_M if image == "east" else float(np.hypot(SIGMA_M, image_sigma_m))
    foretold_m2 = variance_reductions_m2(gain.expected_m2, gain.shared_m4, sigma_m=sigma_m)[least_known(held)]
    label = one_more(block, held, image=image, image_sigma_m=image_sigma_m)
    after = solved_with(loose, (*labels_in_force(block), label))
    assert after.solved.assignment.landmark[-1] == least_known(held)
    solved_m2 = summed_variance_m2(held) - summed_variance_m2(after)
    assert solved_m2 > 0.1  # m^2, of some 10
    # of the gain: a graph is linearised anew, and its kernels weigh anew, where the next solve stops
    assert foretold_m2 == pytest.approx(solved_m2, rel=0.02)


def test_the_map_says_what_a_label_would_tell_in_each_image_and_in_none(held: Solution) -> None:
    assert [gain.image for gain in held.map.gains] == ["", "east"]
    assert gain_of(held, "").landmarks == tuple(one.landmark for one in held.map.landmarks)


def test_in_the_image_that_holds_the_map_a_label_tells_less_than_a_survey(held: Solution) -> None:
    survey, image = (
        variance_reductions_m2(gain.expected_m2, gain.shared_m4, sigma_m=SIGMA_M)[least_known(held)]
        for gain in (gain_of(held, ""), gain_of(held, "east"))
    )
    assert image < survey  # an image's labels say nothing of its own offset
