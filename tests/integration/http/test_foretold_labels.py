"""What is foretold of labels is what the next solve does with them, on a small world that is solved twice."""

import asyncio
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from landmark_maps.examples import checkpoint, logged
from map_http.asking import asked_api
from solved_worlds.examples import FRAME, Lap, World, world
from trigpoint.events.corrected import AnchorLabelled
from trigpoint.events.solved import SolvedMap
from trigpoint.geodesy.projection import map_points_from_wgs84, wgs84_from_map_points
from trigpoint.landmarks.geopackage_features import GeoPackageFeatures
from trigpoint.landmarks.geopackage_store import GeoPackageStore
from trigpoint_landmarks.core.rows import map_change
from trigpoint_landmarks.core.versions import solved_versions
from trigpoint_optimisation.core.solve import solve_map
from trigpoint_optimisation.settings import OdometrySettings, SolveSettings

SETTINGS = SolveSettings(odometry=OdometrySettings(keyframe_m=4.0))  # coarse: quick
IN_FORCE = 12  # labels of the first version, one on each of so many poles
ASIDE = 21  # labels beside poles that are labelled already


@pytest.fixture(scope="module")
def block() -> World:
    return world(Lap(), Lap(vehicle="van", begin_rad=3.5, seed=2, duration_s=50.0))


@pytest.fixture(scope="module")
def prospective(block: World) -> tuple[AnchorLabelled, ...]:
    """A right label for each pole without one, and labels from 0.2 to 4 m beside those with one."""
    spread = _spread(block)
    rest = [one for one in block.anchors if one not in spread]
    random = np.random.default_rng(8)
    beside = [_moved(spread[n % IN_FORCE], f"beside-{n}", random.uniform(-3.0, 3.0, 2)) for n in range(ASIDE)]
    return (*rest, *beside)


@pytest.fixture(scope="module")
def foretold(
    block: World, prospective: Sequence[AnchorLabelled], tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Mapping[str, Any]]:
    """What the service says of each prospective label, by name, on the map of the labels in force."""
    path = tmp_path_factory.mktemp("foretold") / "map.gpkg"
    _stored(path, _solved(block, _spread(block)), _spread(block))
    with asyncio.Runner() as runner, asked_api(GeoPackageFeatures(path), runner) as api:
        yield {one.anchor: api.told("/association", **_asked(one)) for one in prospective}


@pytest.fixture(scope="module")
def done(block: World, prospective: Sequence[AnchorLabelled]) -> Mapping[str, str]:
    """The landmark the next solve ties each label to."""
    solved = _solved(block, (*_spread(block), *prospective))
    return {one.anchor: one.landmark for one in solved.anchors}


def _spread(block: World) -> tuple[AnchorLabelled, ...]:
    """The labels in force: of poles spread over the block."""
    return block.anchors[: 3 * IN_FORCE : 3]


def _moved(label: AnchorLabelled, name: str, by_m: Any) -> AnchorLabelled:
    at_m = map_points_from_wgs84(np.array([label.lat_deg]), np.array([label.lon_deg]), FRAME) + by_m
    lat_deg, lon_deg = wgs84_from_map_points(at_m, FRAME)
    return replace(label, anchor=name, lat_deg=float(lat_deg[0]), lon_deg=float(lon_deg[0]))


def _solved(block: World, anchors: Sequence[AnchorLabelled]) -> SolvedMap:
    return solve_map(block.drives, anchors, FRAME, SETTINGS).map


def _stored(path: Path, solved: SolvedMap, anchors: Sequence[AnchorLabelled]) -> None:
    numbered = [replace(event, map_version=1) for event in solved.events()]
    (version,) = solved_versions(logged(numbered))
    labels = {(one.anchor, one.image): one for one in anchors}
    with closing(GeoPackageStore(path)) as store:
        store.apply(map_change(version, frame=FRAME, labels=labels, valid={}), checkpoint(1))


def _asked(label: AnchorLabelled) -> dict[str, object]:
    names = ("lat_deg", "lon_deg", "sigma_m", "image_sigma_m", "image", "kind", "anchor")
    return {name: getattr(label, name) for name in names}


def test_fifty_labels_are_tied_as_was_foretold(foretold: Mapping[str, Any], done: Mapping[str, str]) -> None:
    assert len(foretold) == 50
    assert {name: one["landmark"] for name, one in foretold.items()} == {name: done[name] for name in foretold}


def test_some_of_them_are_tied_and_some_are_not(foretold: Mapping[str, Any]) -> None:
    reasons = {one["reason"].split(" ")[0] for one in foretold.values()}
    assert {"", "another", "nearest"} <= reasons  # tied; another label is nearer; the nearest landmark is too far
    assert sum(one["landmark"] != "" for one in foretold.values()) > 25
