"""The world as rows of simple solids: cylinders, boxes and crowns, in metres over the ground."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from trigpoint_vehicle.core.lidar_settings import FurnitureSettings
from trigpoint_vehicle.core.scene.ground import surface_heights_m
from trigpoint_vehicle.core.scene.materials import Material
from trigpoint_vehicle.core.scene.traffic import Movers
from trigpoint_vehicle.core.scene.world import Scene, Session

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

CYLINDER, BOX, CROWN = range(3)
STANDS_STILL = -1
BURIED_M = 0.5  # how far what stands reaches into the ground, which slopes
CAR_M = ((4.3, 1.76, 0.25, 0.60), (2.3, 1.60, 0.85, 0.62))  # body and cabin: length, width, bottom, height
WALKER_RADIUS_M, WALKER_HEIGHT_M = 0.24, 1.72


class Solids(NamedTuple):
    """Solids (n,): shape; centre (n, 3) of the foot; size (n, 3): half lengths along and across (a radius in both for
    what is round) and height; facing (n, 2) a unit vector along; material; mover, STANDS_STILL or which mover it is of,
    whose place is added to `centre`.
    """

    shape: Ints
    centre: Floats
    size: Floats
    facing: Floats
    material: Ints
    mover: Ints


@dataclass(frozen=True, slots=True, kw_only=True)
class NamedSolids:
    """The solids of a session, and what each is of, as in the truth where that has it."""

    name: tuple[str, ...]
    solids: Solids


def _rows(shape: int, material: Material, foot_m: Floats, size_m: Floats, *, facing: Floats | None = None) -> Solids:
    count = len(foot_m)
    ahead = np.tile([1.0, 0.0], (count, 1)) if facing is None else np.column_stack([np.cos(facing), np.sin(facing)])
    return Solids(
        shape=np.full(count, shape, dtype=np.int64),
        centre=foot_m.reshape(-1, 3),
        size=size_m.reshape(-1, 3),
        facing=ahead.reshape(-1, 2),
        material=np.full(count, int(material), dtype=np.int64),
        mover=np.full(count, STANDS_STILL, dtype=np.int64),
    )


def _poles(scene: Scene, foot_m: Callable[[Floats], Floats]) -> Solids:
    poles = scene.poles
    foot = foot_m(poles.place_m)
    size = np.column_stack([poles.radius_m, poles.radius_m, poles.height_m])
    return _rows(CYLINDER, Material.POLE, *_buried(foot, size))


def _signs(scene: Scene, foot_m: Callable[[Floats], Floats], settings: FurnitureSettings) -> Solids:
    # the plate is fixed to the front of its pole
    poles, has = scene.poles, np.isfinite(scene.poles.sign_width_m)
    facing, half_m = poles.sign_facing_rad[has], settings.sign_thickness_m / 2.0
    ahead = np.column_stack([np.cos(facing), np.sin(facing), np.zeros(has.sum())])
    foot = foot_m(poles.place_m[has]) + (poles.radius_m[has] + half_m)[:, None] * ahead
    foot[:, 2] += settings.sign_bottom_m
    size = np.column_stack(
        [np.full(has.sum(), half_m), poles.sign_width_m[has] / 2.0, np.full(has.sum(), settings.sign_height_m)]
    )
    return _rows(BOX, Material.SIGN, foot, size, facing=facing)


def _trunks(scene: Scene, foot_m: Callable[[Floats], Floats]) -> Solids:
    trees = scene.trees
    # a trunk ends in the middle of its crown
    height_m = trees.crown_bottom_m + trees.crown_half_height_m
    size = np.column_stack([trees.trunk_radius_m, trees.trunk_radius_m, height_m])
    return _rows(CYLINDER, Material.BARK, *_buried(foot_m(trees.place_m), size))


def _crowns(scene: Scene, foot_m: Callable[[Floats], Floats]) -> Solids:
    trees = scene.trees
    foot = foot_m(trees.place_m)
    foot[:, 2] += trees.crown_bottom_m
    size = np.column_stack([trees.crown_radius_m, trees.crown_radius_m, 2.0 * trees.crown_half_height_m])
    return _rows(CROWN, Material.LEAF, foot, size)


def _buildings(scene: Scene, foot_m: Callable[[Floats], Floats]) -> Solids:
    corner_m = scene.buildings.corner_m
    along_m, out_m = corner_m[:, 1] - corner_m[:, 0], corner_m[:, 3] - corner_m[:, 0]
    foot = foot_m(corner_m.mean(axis=1))
    half_m = np.column_stack([np.hypot(*along_m.T), np.hypot(*out_m.T)]) / 2.0 / scene.scale
    size = np.column_stack([half_m, scene.buildings.height_m])
    return _rows(BOX, Material.WALL, *_buried(foot, size), facing=np.arctan2(along_m[:, 1], along_m[:, 0]))


def _buried(foot_m: Floats, size_m: Floats) -> tuple[Floats, Floats]:
    down_m = np.array([0.0, 0.0, BURIED_M])
    return foot_m - down_m, size_m + down_m


def _car_parts(foot_m: Floats, facing: Floats, scale: Floats) -> list[Solids]:
    parts = []
    for length_m, width_m, bottom_m, height_m in CAR_M:
        size = scale[:, None] * np.array([length_m / 2.0, width_m / 2.0, height_m])
        raised = foot_m + np.outer(scale, [0.0, 0.0, bottom_m])
        parts.append(_rows(BOX, Material.CAR, raised, size, facing=facing))
    return parts


def _moving(movers: tuple[Movers, ...]) -> list[Solids]:
    parts, first = list[Solids](), 0
    for group in movers:
        count = len(group.is_car)
        foot_m, number = np.zeros((count, 3)), first + np.arange(count)
        size = np.tile([WALKER_RADIUS_M, WALKER_RADIUS_M, WALKER_HEIGHT_M], (count, 1))
        drawn = _car_parts(foot_m, np.zeros(count), np.ones(count)) if group.is_car.any() else []
        drawn = drawn or [_rows(CYLINDER, Material.PERSON, foot_m, size)]
        parts += [part._replace(mover=number) for part in drawn]
        first += count
    return parts


def _joined(parts: list[Solids]) -> Solids:
    return Solids(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))


def solids_of(scene: Scene, session: Session, settings: FurnitureSettings) -> NamedSolids:
    """All solids of one session."""

    def foot_m(place_m: Floats) -> Floats:
        ground_m = place_m / scene.scale
        return np.column_stack([ground_m, surface_heights_m(scene.ground, ground_m)])

    parking, taken = scene.parking, session.parked
    cars = _car_parts(foot_m(parking.place_m[taken]), parking.facing_rad[taken], parking.size[taken])
    named = [
        (_poles(scene, foot_m), scene.poles.name),
        (_signs(scene, foot_m, settings), _with_sign(scene)),
        (_trunks(scene, foot_m), tree_names(scene)),
        (_crowns(scene, foot_m), tuple(f"crown of {name}" for name in tree_names(scene))),
        (_buildings(scene, foot_m), tuple(f"building of {name}" for name in scene.buildings.name)),
        *((part, ("parked car",) * len(part.shape)) for part in cars),
        *((part, ("moving",) * len(part.shape)) for part in _moving(session.movers)),
    ]
    return NamedSolids(name=tuple(one for _, names in named for one in names), solids=_joined([p for p, _ in named]))


def tree_names(scene: Scene) -> tuple[str, ...]:
    """The names of the trees' trunks."""
    return tuple(f"trunk-{number:03d}" for number in range(len(scene.trees.place_m)))


def _with_sign(scene: Scene) -> tuple[str, ...]:
    has = np.isfinite(scene.poles.sign_width_m).tolist()
    return tuple(f"sign of {name}" for name, there in zip(scene.poles.name, has, strict=True) if there)


def mover_states(scene: Scene, session: Session, time_s: Floats) -> Floats:
    """Places and velocities (t, m, 5) of all that moves at times (t,): x, y, z in m, vx, vy in m/s, over the ground."""
    states = []
    for one in time_s.tolist():
        moved = [group.at(one) for group in session.movers]
        place_m, velocity = (np.vstack(columns) / scene.scale for columns in zip(*moved, strict=True))
        states.append(np.column_stack([place_m, surface_heights_m(scene.ground, place_m), velocity]))
    return np.array(states)
