"""A map of two versions with landmarks, paths, anchors and an image offset."""

import json
from dataclasses import replace

import numpy as np

from landmark_maps.examples import START_NS, change, landmark, version_row
from trigpoint.landmarks.model import Anchor, ImageOffset, LabelGain, Landmark, MapChange, Trajectory

SIDE_M = 2000.0
COUNT = 300


def crowd(*, seed: int = 5) -> list[Landmark]:
    """Landmarks at random, of two kinds and many sigmas, some of them with letters beyond ASCII in their names."""
    random = np.random.default_rng(seed)
    at_m = random.uniform(-SIDE_M / 2, SIDE_M / 2, (COUNT, 2)).tolist()
    sigma_m = random.uniform(0.05, 2.0, COUNT).tolist()
    return [
        landmark(f"{'ÄL'[n % 2]}{n}", *at_m[n], kind=("pole", "Corner", "a_b%c\\d")[n % 3])._replace(
            sigma_major_m=sigma_m[n],
            observation_count=n,
            first_seen_ns=START_NS + n * 1_000_000_000,
            last_seen_ns=START_NS + (n + 10) * 1_000_000_000,
            anchored=n % 5 == 0,
        )
        for n in range(COUNT)
    ]


def path(vehicle: str, *, map_version: int, shift_m: float = 0.0) -> Trajectory:
    """A drive in a wave through the map."""
    steps = np.linspace(-900.0, 900.0, 200)
    east_m = 332_000.0 + steps
    north_m = 6_248_000.0 + shift_m + 200.0 * np.sin(steps / 150.0)
    return Trajectory(
        map_version=map_version,
        vehicle=vehicle,
        boot_id="boot-1",
        first_stamp_ns=START_NS,
        last_stamp_ns=START_NS + 200_000_000_000,
        pose_count=len(steps),
        length_m=2500.0,
        calibration_json='[["speed_scale", 1.01, 0.001]]',
        path=tuple(zip(east_m.tolist(), north_m.tolist(), strict=True)),
    )


def anchor(name: str, *, image: str = "tile-1", map_version: int = 1, placed: bool = True) -> Anchor:
    """An anchor tied to L1, or one whose label is not known."""
    at = landmark(name, 40.0, 50.0)
    return Anchor(
        map_version=map_version,
        anchor=name,
        image=image,
        kind="pole",
        signature="",
        landmark="L1" if placed else "",
        reason="" if placed else "no landmark within reach",
        sigma_m=0.1 if placed else None,
        residual_x_m=0.3 if placed else None,
        residual_y_m=-0.4 if placed else None,
        residual_m=0.5 if placed else None,
        lat_deg=at.lat_deg if placed else None,
        lon_deg=at.lon_deg if placed else None,
        easting_m=at.easting_m if placed else None,
        northing_m=at.northing_m if placed else None,
    )


def offset(*, map_version: int = 1, x_m: float = 0.2) -> ImageOffset:
    """The offset of one image."""
    return ImageOffset(
        map_version=map_version,
        image="tile-1",
        offset_x_m=x_m,
        offset_y_m=-0.1,
        variance_x_m2=0.01,
        covariance_xy_m2=0.0,
        variance_y_m2=0.01,
    )


def gain(image: str, *landmarks: str) -> LabelGain:
    """What one more label of each of these landmarks would tell, of the first less than of the next."""
    terms = [[0.04, 0.0, 0.04, 0.1 * (row + 1), 0.0, 0.1] for row in range(len(landmarks))]
    return LabelGain(map_version=1, image=image, landmarks_json=json.dumps(landmarks), terms_json=json.dumps(terms))


def two_versions() -> tuple[MapChange, MapChange]:
    """A whole version, and one that moves every third landmark by 10 m to the north, and one of two paths."""
    rows = crowd()
    moved = [landmark(row.landmark, row.x_m, row.y_m + 10.0, kind=row.kind)._replace() for row in rows[::3]]
    first = replace(
        change(1, opened=rows),
        trajectories=(path("veh-a", map_version=1), path("veh-b", map_version=1, shift_m=50.0)),
        anchors=(anchor("a1"), anchor("a/2", image=""), anchor("a3", placed=False)),
        image_offsets=(offset(),),
        label_gains=(gain("", rows[0].landmark, rows[1].landmark), gain("tile-1", rows[1].landmark)),
    )
    second = replace(
        change(2, opened=moved, closed=[row.landmark for row in moved]),
        version=replace(version_row(2, landmark_count=COUNT), base_version=1),
        trajectories=(path("veh-b", map_version=2, shift_m=60.0),),
        anchors=(anchor("a1", map_version=2),),
        image_offsets=(offset(map_version=2, x_m=0.25),),
    )
    return first, second
