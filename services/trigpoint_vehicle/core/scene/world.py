"""The whole world around a campus's streets and landmarks, and each session's cars and walkers in it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from trigpoint_vehicle.core.campus_settings import LandmarkSettings
from trigpoint_vehicle.core.lidar_settings import FurnitureSettings, SceneSettings, TrafficSettings
from trigpoint_vehicle.core.motion import Motion
from trigpoint_vehicle.core.placement import PlacedLandmarks
from trigpoint_vehicle.core.scene.buildings import Buildings, raised_buildings
from trigpoint_vehicle.core.scene.free_ground import FreeGround
from trigpoint_vehicle.core.scene.furniture import Poles, Trees, erected_poles, planted_trees
from trigpoint_vehicle.core.scene.ground import Ground, laid_ground
from trigpoint_vehicle.core.scene.markings import STRIPES
from trigpoint_vehicle.core.scene.traffic import Movers, Parking, Standing, drawn_movers, parking_places
from trigpoint_vehicle.core.streets import Streets

Bools = NDArray[np.bool_]

# Each part draws from a stream of its own, and none from those of the campus itself (`campus._stream`).
GROUND, BUILDINGS, POLES, TREES, PARKING, PARKED, MOVERS = range(100, 107)
DRIVEN_EVERY = 20  # samples of a motion that are kept clear: over a metre


@dataclass(frozen=True, slots=True, kw_only=True)
class Session:
    """What is different each time: which parking places are taken, and what moves; times are a motion's own."""

    parked: Bools
    movers: tuple[Movers, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Scene:
    """The world. Places are grid metres from the campus's corner, but `ground` is in metres over the ground from there;
    `scale` is grid metres for one metre on the ground. One session a vehicle."""

    scale: float
    ground: Ground
    buildings: Buildings
    poles: Poles
    trees: Trees
    parking: Parking
    sessions: tuple[Session, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Laid:
    """A campus as far as the world depends on it: its streets, landmarks and drives, `scale` as in `Scene`."""

    streets: Streets
    landmarks: PlacedLandmarks
    motions: Sequence[Motion]
    scale: float


@dataclass(frozen=True, slots=True, kw_only=True)
class _Around:
    standing: Standing
    parking: Parking


def _stream(seed: int, part: int, session: int = 0) -> np.random.Generator:
    return np.random.default_rng([seed, part, session])


def _buildings(laid: Laid, free: FreeGround, settings: FurnitureSettings, rng: np.random.Generator) -> Buildings:
    landmarks, poles = laid.landmarks, laid.landmarks.kind.count("pole")
    standing_m, corner_m = landmarks.position_m[:poles], landmarks.position_m[poles:]
    names, footprint = raised_buildings(landmarks.name[poles:], corner_m, standing_m, free, settings)
    height_m = rng.uniform(settings.building_height_min_m, settings.building_height_max_m, len(names))
    return Buildings(name=names, corner_m=footprint, height_m=height_m)


def _session(seed: int, number: int, laid: Laid, around: _Around, settings: TrafficSettings) -> Session:
    chance = _stream(seed, PARKED, number).uniform(size=len(around.parking.size))
    rng = _stream(seed, MOVERS, number)
    return Session(
        parked=chance < settings.parked_share,
        movers=drawn_movers(around.standing, laid.streets, laid.motions[number], settings, rng),
    )


def made_scene(seed: int, laid: Laid, weights: LandmarkSettings, settings: SceneSettings) -> Scene:
    """The world of a seed: the same seed and settings give the same, bit for bit."""
    driven_m = np.vstack([motion.pose[::DRIVEN_EVERY, :2] for motion in laid.motions])
    free = FreeGround(streets=laid.streets, driven=cKDTree(driven_m))
    buildings = _buildings(laid, free, settings.furniture, _stream(seed, BUILDINGS))
    trees = planted_trees(
        laid.landmarks.position_m,
        buildings.corner_m,
        free,
        settings.furniture,
        weights=weights,
        rng=_stream(seed, TREES),
    )
    standing_m = np.vstack([laid.landmarks.position_m, trees.place_m])
    standing = Standing(place_m=standing_m, footprint=buildings.corner_m)
    parking = parking_places(standing, free, settings.traffic, _stream(seed, PARKING))
    around = _Around(standing=standing, parking=parking)
    return Scene(
        scale=laid.scale,
        ground=laid_ground(laid.streets, STRIPES, settings.ground, scale=laid.scale, rng=_stream(seed, GROUND)),
        buildings=buildings,
        poles=erected_poles(laid.landmarks, free, settings.furniture, _stream(seed, POLES)),
        trees=trees,
        parking=parking,
        sessions=tuple(_session(seed, n, laid, around, settings.traffic) for n in range(len(laid.motions))),
    )
