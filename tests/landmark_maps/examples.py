"""Small maps by hand: the frame is UTM 56S (Sydney) with its origin at 332 000 E, 6 248 000 N."""

from collections.abc import Sequence

import numpy as np

from trigpoint.events.corrected import AnchorLabelled
from trigpoint.events.envelope import Envelope, EventIdentity, LogPosition
from trigpoint.events.keys import STREAM_PATTERNS
from trigpoint.events.mapped import (
    AnchorAssociated,
    ImageOffsetSolved,
    LabelGainSolved,
    LandmarkSolved,
    Mapped,
    MapSolved,
    TrajectorySolved,
)
from trigpoint.events.observed import MapFramePinned
from trigpoint.events.runs import LoggedRun, encoded
from trigpoint.geodesy.positions import GridPosition, MapPosition
from trigpoint.geodesy.projection import MapFrame, pin_map_frame, wgs84_from_map
from trigpoint.landmarks.model import Checkpoint, Landmark, MapChange, MapVersion
from trigpoint.logs.ports import EventLog
from trigpoint_landmarks.core.rows import map_change
from trigpoint_landmarks.core.versions import solved_versions

CRS = "EPSG:32756"
ORIGIN = GridPosition(332_000.0, 6_248_000.0)
SECOND_NS = 1_000_000_000
START_NS = 1_700_000_000 * SECOND_NS
MAP_STREAM = STREAM_PATTERNS[MapSolved]
LABEL_STREAM = STREAM_PATTERNS[AnchorLabelled]
FRAME_STREAM = STREAM_PATTERNS[MapFramePinned]


def frame() -> MapFrame:
    return pin_map_frame(crs=CRS, origin=ORIGIN)


def landmark(name: str, x_m: float, y_m: float, *, map_version: int = 1, kind: str = "pole") -> Landmark:
    """A landmark of round figures, valid from `map_version` on."""
    wgs84 = wgs84_from_map(MapPosition(x_m, y_m), frame())
    return Landmark(
        landmark=name,
        kind=kind,
        signature="",
        x_m=x_m,
        y_m=y_m,
        easting_m=x_m + ORIGIN.easting_m,
        northing_m=y_m + ORIGIN.northing_m,
        lat_deg=wgs84.lat_deg,
        lon_deg=wgs84.lon_deg,
        variance_x_m2=0.04,
        covariance_xy_m2=0.01,
        variance_y_m2=0.09,
        sigma_major_m=0.3,
        sigma_minor_m=0.2,
        ellipse_heading_rad=1.5,
        observation_count=12,
        vehicles=("veh-a", "veh-b"),
        first_seen_ns=START_NS,
        last_seen_ns=START_NS + 60 * SECOND_NS,
        anchored=True,
        anchors=("anchor-1",),
        provenance='{"veh-a/boot-1": [3, 4]}',
        valid_from_version=map_version,
        valid_to_version=None,
    )


def version_row(map_version: int = 1, *, landmark_count: int = 0, crs: str = CRS) -> MapVersion:
    return MapVersion(
        map_version=map_version,
        base_version=0,
        method="anchored",
        settings_json="{}",
        inputs_json="[]",
        landmark_count=landmark_count,
        anchor_count=0,
        wall_s=1.5,
        solved_ns=START_NS,
        log_stream=MAP_STREAM,
        log_number=10 * map_version,
        crs=crs,
        origin_easting_m=ORIGIN.easting_m,
        origin_northing_m=ORIGIN.northing_m,
        operation="",
        operation_accuracy_m=-1.0,
    )


def change(
    map_version: int = 1, *, opened: Sequence[Landmark] = (), closed: Sequence[str] = (), crs: str = CRS
) -> MapChange:
    """A map version that opens and closes landmarks, and nothing else."""
    return MapChange(
        version=version_row(map_version, landmark_count=len(opened), crs=crs),
        opened=tuple(row._replace(valid_from_version=map_version) for row in opened),
        closed=tuple(closed),
        trajectories=(),
        anchors=(),
        image_offsets=(),
    )


def checkpoint(next_number: int) -> Checkpoint:
    return Checkpoint(((MAP_STREAM, next_number),))


def solved_landmark(name: str, x_m: float, y_m: float, *, map_version: int = 1) -> LandmarkSolved:
    return LandmarkSolved(
        map_version=map_version,
        landmark=name,
        kind="pole",
        signature="",
        position_m=np.array([x_m, y_m]),
        covariance_m2=np.array([[0.04, 0.01], [0.01, 0.09]]),
        observation_count=3,
        vehicles=("veh-a",),
        first_seen_ns=START_NS,
        last_seen_ns=START_NS + SECOND_NS,
        anchors=("anchor-1",) if name == "L1" else (),
        observations=(("veh-a", "boot-1", 7), ("veh-a", "boot-1", 8), ("veh-b", "boot-9", 1)),
    )


def solved_trajectory(*, map_version: int = 1, pose_count: int = 3) -> TrajectorySolved:
    """A drive straight east, a pose a second and every 10 m."""
    steps = np.arange(pose_count, dtype=np.float64)
    return TrajectorySolved(
        map_version=map_version,
        vehicle="veh-a",
        boot_id="boot-1",
        stamp_ns=START_NS + np.arange(pose_count, dtype=np.int64) * SECOND_NS,
        pose=np.column_stack([10.0 * steps, np.zeros_like(steps), np.zeros_like(steps)]),
        covariance=np.tile(np.eye(3), (pose_count, 1, 1)),
        calibration=(("speed_scale", 1.01, 0.001),),
    )


def associated(anchor: str, landmark_name: str, *, map_version: int = 1) -> AnchorAssociated:
    """An anchor tied to a landmark, or to none."""
    return AnchorAssociated(
        map_version=map_version,
        anchor=anchor,
        landmark=landmark_name,
        reason="" if landmark_name else "no landmark within reach",
        residual_m=np.array([0.3, -0.4]) if landmark_name else np.array([np.nan, np.nan]),
    )


def image_offset(*, map_version: int = 1) -> ImageOffsetSolved:
    return ImageOffsetSolved(
        map_version=map_version, image="tile-1", offset_m=np.array([0.2, -0.1]), covariance_m2=0.01 * np.eye(2)
    )


def label_gain(landmarks: Sequence[str], *, map_version: int = 1) -> LabelGainSolved:
    """What one more label in no known image would tell."""
    terms = np.tile([0.04, 0.01, 0.09], (len(landmarks), 1))
    return LabelGainSolved(
        map_version=map_version, image="", landmarks=tuple(landmarks), expected_m2=terms, shared_m4=0.5 * terms
    )


def label(anchor: str, *, lat_deg: float = -33.89, lon_deg: float = 151.19) -> AnchorLabelled:
    return AnchorLabelled(
        anchor=anchor,
        lat_deg=lat_deg,
        lon_deg=lon_deg,
        sigma_m=0.1,
        image="tile-1",
        image_sigma_m=0.35,
        kind="pole",
        signature="",
        source_crs="EPSG:4326",
        operation="",
    )


def closing(map_version: int, landmark_count: int, *, labels: int = 0) -> MapSolved:
    return MapSolved(
        map_version=map_version,
        method="anchored",
        settings_json="{}",
        inputs=((LABEL_STREAM, labels), ("veh-veh-a", 100)),
        landmark_count=landmark_count,
        anchor_count=labels,
        wall_s=1.5,
    )


def solved_map(map_version: int, landmarks: Sequence[LandmarkSolved], *, labels: int = 0) -> list[Mapped]:
    """The events of one whole map version."""
    return [
        solved_trajectory(map_version=map_version),
        *landmarks,
        associated("anchor-1", "L1", map_version=map_version),
        associated("anchor-2", "", map_version=map_version),
        image_offset(map_version=map_version),
        closing(map_version, len(landmarks), labels=labels),
    ]


def logged(events: Sequence[Mapped], *, boot_id: str = "boot-1", first: int = 0) -> list[LoggedRun]:
    """Events of the optimiser as they stand in its stream from number `first` on."""
    return [
        LoggedRun(
            LogPosition(MAP_STREAM, number),
            encoded(Envelope(EventIdentity("trigpoint_optimisation", boot_id, number), START_NS, event)),
        )
        for number, event in enumerate(events, start=first)
    ]


def append_mapped(log: EventLog, events: Sequence[Mapped], *, boot_id: str = "boot-1") -> None:
    """Events of the optimiser at the end of its stream."""
    first = log.next_number(MAP_STREAM)
    log.append(
        MAP_STREAM,
        [
            Envelope(EventIdentity("trigpoint_optimisation", boot_id, first + index), START_NS + first + index, event)
            for index, event in enumerate(events)
        ],
    )


def append_labels(log: EventLog, labels: Sequence[AnchorLabelled]) -> None:
    """Anchors at the end of their stream."""
    first = log.next_number(LABEL_STREAM)
    rows = [
        Envelope(EventIdentity("surveyor", "boot-1", first + index), START_NS, row) for index, row in enumerate(labels)
    ]
    log.append(LABEL_STREAM, rows)


def pin_frame(log: EventLog) -> None:
    """The frame of these maps, pinned."""
    event = MapFramePinned(
        crs=CRS, origin_easting_m=ORIGIN.easting_m, origin_northing_m=ORIGIN.northing_m, declared_by="test"
    )
    log.append(FRAME_STREAM, [Envelope(EventIdentity("trigpoint_ingest", "boot-1", 0), START_NS, event)])


def whole_change(map_version: int = 1) -> MapChange:
    """A map version with something in every table, as the service makes it from events."""
    *parts, head = solved_map(map_version, [solved_landmark("L1", 1.5, 2.5, map_version=map_version)], labels=1)
    events = [*parts, label_gain(["L1"], map_version=map_version), head]
    (version,) = solved_versions(logged(events))
    return map_change(version, frame=frame(), labels={("anchor-1", "tile-1"): label("anchor-1")}, valid={})
