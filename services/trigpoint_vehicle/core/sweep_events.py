"""Detections of one instant gathered into one sweep."""

from collections.abc import Iterable

from trigpoint.events.observed import LandmarkDetection, LandmarksDetected
from trigpoint_vehicle.core.recording import Timed


def sweeps_of(stamps: Iterable[int], detections: Iterable[LandmarkDetection | None]) -> list[Timed]:
    """One event for all detections of the same instant, in the order given; None is a sweep that saw nothing."""
    by_stamp: dict[int, list[LandmarkDetection]] = {}
    for stamp, detection in zip(stamps, detections, strict=True):
        by_stamp.setdefault(stamp, []).extend([detection] if detection is not None else [])
    return [(stamp, LandmarksDetected(detections=tuple(seen))) for stamp, seen in by_stamp.items()]
