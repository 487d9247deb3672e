"""A campus whose vehicles carry a lidar: the same drives with points among their rows, and the truth of what is hit."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from trigpoint.events.truth import Truth, TruthLandmark
from trigpoint.events.truth_objects import TruthObject
from trigpoint.geodesy.projection import wgs84_from_map_points
from trigpoint_vehicle.core.campus import Campus, first_stamp_ns
from trigpoint_vehicle.core.campus_settings import CampusSettings
from trigpoint_vehicle.core.lidar.scanned_rows import Casting, ScannedRows
from trigpoint_vehicle.core.lidar.scans import DriveScans
from trigpoint_vehicle.core.lidar.solids import solids_of, tree_names
from trigpoint_vehicle.core.lidar_settings import CarriedLidar
from trigpoint_vehicle.core.recording import Conversion, Recording, boot_id_of
from trigpoint_vehicle.core.scene.ground import surface_heights_m
from trigpoint_vehicle.core.scene.world import Laid, Scene, made_scene

Floats = NDArray[np.float64]

OTHER_CORNERS = ("", "-b", "-c", "-d")  # after a corner landmark's name, round its building


@dataclass(frozen=True, slots=True, kw_only=True)
class ScannedCampus:
    """A campus whose `recordings` have points; its scene, its drives' sweeps, and the truth with all objects."""

    campus: Campus
    scene: Scene
    scans: tuple[DriveScans, ...]
    recordings: tuple[Recording, ...]
    truth: Truth
    objects: tuple[TruthObject, ...]


@dataclass(frozen=True, slots=True)
class _Upright:
    kind: tuple[str, ...]
    name: tuple[str, ...]
    place_m: Floats
    height_m: Floats
    radius_m: Floats


def _uprights(scene: Scene) -> tuple[_Upright, _Upright, _Upright]:
    poles, trees, buildings = scene.poles, scene.trees, scene.buildings
    kinds = tuple("sign" if there else "pole" for there in np.isfinite(poles.sign_width_m).tolist())
    trunks, corner_m = tree_names(scene), buildings.corner_m.reshape(-1, 2)
    corners = tuple(name + other for name in buildings.name for other in OTHER_CORNERS)
    height_m = np.repeat(buildings.height_m, len(OTHER_CORNERS))
    return (
        _Upright(kinds, poles.name, poles.place_m, poles.height_m, poles.radius_m),
        _Upright(("trunk",) * len(trunks), trunks, trees.place_m, trees.crown_bottom_m, trees.trunk_radius_m),
        _Upright(("corner",) * len(corners), corners, corner_m, height_m, np.full(len(corners), np.nan)),
    )


def _objects(scene: Scene, campus: Campus) -> tuple[TruthObject, ...]:
    objects = list[TruthObject]()
    for group in _uprights(scene):
        lat_deg, lon_deg = wgs84_from_map_points(group.place_m, campus.frame)
        ground_m = surface_heights_m(scene.ground, group.place_m / scene.scale)
        columns = (lat_deg, lon_deg, ground_m, group.height_m, group.radius_m)
        rows = zip(group.kind, group.name, *(column.tolist() for column in columns), strict=True)
        objects += [
            TruthObject(kind=k, name=n, lat_deg=lat, lon_deg=lon, ground_m=g, height_m=h, radius_m=r)
            for k, n, lat, lon, g, h, r in rows
        ]
    return tuple(objects)


def _truth(truth: Truth, objects: tuple[TruthObject, ...]) -> Truth:
    # with the landmarks only a lidar sees
    known = {one.landmark for one in truth.landmarks}
    more = tuple(
        TruthLandmark(landmark=one.name, lat_deg=one.lat_deg, lon_deg=one.lon_deg, signature="")
        for one in objects
        if one.name not in known
    )
    return replace(truth, landmarks=truth.landmarks + more)


def scanned_campus(
    campus: Campus, settings: CampusSettings, carried: CarriedLidar, *, seed: int, casting: Casting = map
) -> ScannedCampus:
    """A campus of a seed and settings with a lidar on each vehicle; `casting` as in `ScannedRows`."""
    scale = campus.frame.point_scale
    laid = Laid(streets=campus.streets, landmarks=campus.landmarks, motions=campus.motions, scale=scale)
    scene = made_scene(seed, laid, settings.landmarks, carried.scene)
    scans = tuple(
        DriveScans(
            scene=scene,
            session=session,
            solids=solids_of(scene, session, carried.scene.furniture),
            motion=campus.motions[number],
            settings=carried.lidar,
            first_stamp_ns=first_stamp_ns(settings, number),
            seed=seed,
            number=number,
        )
        for number, session in enumerate(scene.sessions)
    )
    objects = _objects(scene, campus)
    return ScannedCampus(
        campus=campus,
        scene=scene,
        scans=scans,
        recordings=tuple(
            _scanned(recording, drive, carried, casting)
            for recording, drive in zip(campus.recordings, scans, strict=True)
        ),
        truth=_truth(campus.truth, objects),
        objects=objects,
    )


def _scanned(recording: Recording, drive: DriveScans, carried: CarriedLidar, casting: Casting) -> Recording:
    boot_id = boot_id_of(recording.rows[0].identity.boot_id.encode(), repr(carried).encode())
    return replace(recording, rows=ScannedRows(recording.rows, drive, boot_id=boot_id, casting=casting))


def conversion_with_points(scanned: ScannedCampus) -> Conversion:
    """A campus with points in the form the importers give."""
    return Conversion(
        recordings=scanned.recordings,
        truth=scanned.truth,
        anchors=scanned.campus.anchors,
        objects=scanned.objects,
    )
