"""What perception found, as part of the drives it was found in: detections with their covariances, motions, loops."""

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import cast

import numpy as np

from trigpoint.events.drives import CAMERA, NO_LOOPS, NO_MOTIONS, DetectionSeries, Drive, LoopSeries, MotionSeries
from trigpoint.events.envelope import Envelope
from trigpoint.events.keys import STREAM_PATTERNS
from trigpoint.events.observed import LandmarkDetection, LandmarksDetected, VehicleDescribed
from trigpoint.events.perceived import LandmarksPerceived, LoopClosed, OdometryMatched, Perceived, PerceivedLandmark
from trigpoint.geodesy.poses import Pose2
from trigpoint.logs.ports import EventLog, LoggedEvent

PERCEIVED_STREAM = STREAM_PATTERNS[LandmarksPerceived]

DriveName = tuple[str, str]


def with_perceived(drives: Iterable[Drive], log: EventLog) -> tuple[Drive, ...]:
    """The drives with what perception found in their sweeps: its landmarks among the detections, each named by its
    sweep's sequence, the motions it matched, and the loops it closed.

    Where a drive was perceived, or its loops sought, more than once, by other settings, the last time counts. Where
    perception found something in a drive, what the vehicle itself detected from the first to the last perceived sweep
    stands back: both saw the same things. Its detections with a signature stay, other vehicles' too; and a camera's,
    beside which nothing that was perceived counts.
    """
    by_name = {(drive.vehicle, drive.boot_id): drive for drive in drives}
    told = _last_told(log, by_name.keys(), (LandmarksPerceived, OdometryMatched))
    loops = closed_loops(log, by_name.keys())
    return tuple(
        replace(_completed(drive, _told(told, name)), loops=_loop_series(_told(loops, name)))
        for name, drive in by_name.items()
    )


def closed_loops(log: EventLog, names: Collection[DriveName]) -> dict[DriveName, list[LoggedEvent]]:
    """The loops of each named drive that has some, of the settings they were sought by last."""
    return _last_told(log, names, (LoopClosed,))


def _last_told(
    log: EventLog, names: Collection[DriveName], kinds: Sequence[type]
) -> dict[DriveName, list[LoggedEvent]]:
    """What was told of each named drive, of some kinds of events, under the boot that told of it last."""
    told: dict[DriveName, list[LoggedEvent]] = {}
    for row in log.read(PERCEIVED_STREAM, kinds=kinds):
        event = cast(Perceived, row.envelope.event)
        name = (event.vehicle, event.boot_id)
        if name not in names:
            continue
        earlier = told.setdefault(name, [])
        if earlier and earlier[-1].envelope.identity.boot_id != row.envelope.identity.boot_id:
            earlier.clear()
        earlier.append(row)
    return told


def _told(told: Mapping[DriveName, Sequence[LoggedEvent]], name: DriveName) -> list[Envelope[Perceived]]:
    return [cast(Envelope[Perceived], row.envelope) for row in told.get(name, ())]


def _completed(drive: Drive, told: Sequence[Envelope[Perceived]]) -> Drive:
    swept = [(row.stamp_ns, row.event) for row in told if isinstance(row.event, LandmarksPerceived)]
    matched = [(row.stamp_ns, row.event) for row in told if isinstance(row.event, OdometryMatched)]
    detections = drive.detections
    if any(event.landmarks for _, event in swept) and drive.described.landmark_sensor_model != CAMERA:
        stamps_ns = [stamp_ns for stamp_ns, _ in swept]
        own = _standing(drive.detections, from_ns=min(stamps_ns), until_ns=max(stamps_ns))
        detections = _joined(own, _perceived_series(swept, drive.described))
    return replace(drive, detections=detections, matched=_motion_series(matched))


def _perceived_series(swept: Iterable[tuple[int, LandmarksPerceived]], described: VehicleDescribed) -> DetectionSeries:
    """The landmarks of sweeps, each with its stamp, as detections by the vehicle's landmark sensor."""
    T_sensor_base = _T_sensor_base(described)
    rows = [(stamp_ns, event.sweep_sequence, each) for stamp_ns, event in swept for each in event.landmarks]
    rows.sort(key=lambda row: row[:2])
    found = [_detection(each, T_sensor_base) for _, _, each in rows]
    covariance = [
        (each.variance_x_m2, each.covariance_xy_m2, each.covariance_xy_m2, each.variance_y_m2) for _, _, each in rows
    ]
    return DetectionSeries(
        stamp_ns=np.array([stamp_ns for stamp_ns, _, _ in rows], dtype=np.int64),
        range_m=np.array([each.range_m for each in found]),
        bearing_rad=np.array([each.bearing_rad for each in found]),
        diameter_m=np.array([each.diameter_m for each in found]),
        kind=tuple(each.kind for each in found),
        signature=tuple(each.signature for each in found),
        sequence=np.array([sequence for _, sequence, _ in rows], dtype=np.int64),
        covariance_m2=np.array(covariance).reshape(-1, 2, 2),
    )


def _standing(series: DetectionSeries, *, from_ns: int, until_ns: int) -> DetectionSeries:
    """The detections that say what they are of, and those outside the time."""
    outside = (series.stamp_ns < from_ns) | (series.stamp_ns > until_ns)
    signed = np.array([bool(signature) for signature in series.signature], dtype=bool)
    return series.chosen(np.nonzero(outside | signed)[0])


def _joined(own: DetectionSeries, perceived: DetectionSeries) -> DetectionSeries:
    """Both in order of time; NaN covariances of those that have none."""
    assert perceived.covariance_m2 is not None, "perception tells a covariance of each"
    none = np.full((len(own.stamp_ns), 2, 2), np.nan)
    both = DetectionSeries(
        stamp_ns=np.concatenate([own.stamp_ns, perceived.stamp_ns]),
        range_m=np.concatenate([own.range_m, perceived.range_m]),
        bearing_rad=np.concatenate([own.bearing_rad, perceived.bearing_rad]),
        diameter_m=np.concatenate([own.diameter_m, perceived.diameter_m]),
        kind=own.kind + perceived.kind,
        signature=own.signature + perceived.signature,
        sequence=np.concatenate([own.sequence, perceived.sequence]),
        covariance_m2=np.concatenate([none, perceived.covariance_m2]),
    )
    return both.chosen(np.argsort(both.stamp_ns, kind="stable"))


def _motion_series(matched: Iterable[tuple[int, OdometryMatched]]) -> MotionSeries:
    """Motions from sweep to sweep, sensor by sensor in order of time."""
    rows = sorted(matched, key=lambda row: (row[1].sensor, row[0]))
    if not rows:
        return NO_MOTIONS
    return MotionSeries(
        from_stamp_ns=np.array([event.from_stamp_ns for _, event in rows], dtype=np.int64),
        stamp_ns=np.array([stamp_ns for stamp_ns, _ in rows], dtype=np.int64),
        motion=np.array([(event.x_m, event.y_m, event.heading_rad) for _, event in rows]),
        covariance=np.array([event.covariance for _, event in rows]),
    )


def _loop_series(told: Sequence[Envelope[Perceived]]) -> LoopSeries:
    """Loops in order of time."""
    rows = sorted(((row.stamp_ns, row.event) for row in told), key=lambda row: row[0])
    closed = [(stamp_ns, event) for stamp_ns, event in rows if isinstance(event, LoopClosed)]
    if not closed:
        return NO_LOOPS
    return LoopSeries(
        other=tuple((event.other_vehicle, event.other_boot_id) for _, event in closed),
        motions=MotionSeries(
            from_stamp_ns=np.array([event.other_stamp_ns for _, event in closed], dtype=np.int64),
            stamp_ns=np.array([stamp_ns for stamp_ns, _ in closed], dtype=np.int64),
            motion=np.array([(event.x_m, event.y_m, event.heading_rad) for _, event in closed]),
            covariance=np.array([event.covariance for _, event in closed]),
        ),
    )


def detected_in(event: LandmarksPerceived, described: VehicleDescribed) -> LandmarksDetected:
    """A sweep's landmarks by range and bearing from the vehicle's landmark sensor, without a signature."""
    T_sensor_base = _T_sensor_base(described)
    return LandmarksDetected(detections=tuple(_detection(landmark, T_sensor_base) for landmark in event.landmarks))


def _T_sensor_base(described: VehicleDescribed) -> Pose2:
    x_m, y_m = described.landmark_sensor_x_m, described.landmark_sensor_y_m
    return Pose2(x_m, y_m, described.landmark_sensor_yaw_rad).inverse()


def _detection(landmark: PerceivedLandmark, T_sensor_base: Pose2) -> LandmarkDetection:
    x_m, y_m = T_sensor_base.transform(landmark.x_m, landmark.y_m)
    return LandmarkDetection(math.hypot(x_m, y_m), math.atan2(y_m, x_m), landmark.kind, "", landmark.diameter_m)
