"""What one sweep saw, hung on a keyframe: by detections of range and bearing, or by what perception found in points."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trigpoint.events.drives import CAMERA
from trigpoint.events.observed import LandmarksDetected, VehicleDescribed
from trigpoint.events.perceived import LandmarksPerceived
from trigpoint.geodesy.poses import transform_points
from trigpoint_optimisation.core.known_landmark_slam import BEARING_SIGMA_RAD, LN_RANGE_SIGMA
from trigpoint_optimisation.core.live_tracks import Sweep
from trigpoint_optimisation.core.single_sightings import VEHICLE
from trigpoint_optimisation.settings import DetectionSettings

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Hook:
    """Where a sweep hangs: its stamp and number, its keyframe, T_odom_keyframe (3,) and, at the stamp,
    T_keyframe_base (3,)."""

    stamp_ns: int
    sequence: int
    keyframe: int
    T_odom_keyframe: Floats
    T_keyframe_base: Floats


@dataclass(frozen=True, slots=True, kw_only=True)
class SweepReading:
    """What makes a sweep of an event: the vehicle, the settings' noise, the map's metres per metre."""

    described: VehicleDescribed
    settings: DetectionSettings
    point_scale: float

    def sweep(self, event: LandmarksDetected | LandmarksPerceived, hook: Hook) -> Sweep:
        """What the event saw within the settings' range, other vehicles left out."""
        if isinstance(event, LandmarksPerceived):
            return self._perceived(event, hook)
        return self._detected(event, hook)

    def _detected(self, event: LandmarksDetected, hook: Hook) -> Sweep:
        most_m = self.settings.max_range_m
        rows = [row for row, each in enumerate(event.detections) if each.kind != VEHICLE and each.range_m <= most_m]
        found = [event.detections[row] for row in rows]
        range_m = np.array([each.range_m for each in found])
        bearing = np.array([each.bearing_rad for each in found]) + self.described.landmark_sensor_yaw_rad
        ray = range_m[:, None] * np.column_stack([np.cos(bearing), np.sin(bearing)])
        point_m = transform_points(hook.T_keyframe_base, self.point_scale * (self._mount_m() + ray))
        return Sweep(
            stamp_ns=hook.stamp_ns,
            sequence=hook.sequence,
            keyframe=hook.keyframe,
            row=tuple(rows),
            point_odom_m=transform_points(hook.T_odom_keyframe, point_m),
            point_m=point_m,
            covariance=self._covariances(range_m, bearing + hook.T_keyframe_base[2]),
            told=False,
            kind=tuple(each.kind for each in found),
            signature=tuple(each.signature for each in found),
        )

    def _perceived(self, event: LandmarksPerceived, hook: Hook) -> Sweep:
        every_m = np.array([(each.x_m, each.y_m) for each in event.landmarks]).reshape(-1, 2)
        rows = np.nonzero(np.hypot(*(every_m - self._mount_m()).T) <= self.settings.max_range_m)[0].tolist()
        found = [event.landmarks[row] for row in rows]
        xy_m2 = [(one.variance_x_m2, one.covariance_xy_m2, one.covariance_xy_m2, one.variance_y_m2) for one in found]
        point_m = transform_points(hook.T_keyframe_base, self.point_scale * every_m[rows])
        return Sweep(
            stamp_ns=hook.stamp_ns,
            sequence=hook.sequence,
            keyframe=hook.keyframe,
            row=tuple(rows),
            point_odom_m=transform_points(hook.T_odom_keyframe, point_m),
            point_m=point_m,
            covariance=_turned(np.array(xy_m2).reshape(-1, 2, 2), hook.T_keyframe_base[2]),
            told=True,
            kind=tuple(each.kind for each in found),
            signature=("",) * len(found),
        )

    def _mount_m(self) -> Floats:
        return np.array([self.described.landmark_sensor_x_m, self.described.landmark_sensor_y_m])

    def _covariances(self, range_m: Floats, angle_rad: Floats) -> Floats:
        """Covariances (d, 2, 2) of detected points in the keyframe's frame."""
        camera, detections = self.described.landmark_sensor_model == CAMERA, self.settings
        along = (LN_RANGE_SIGMA * range_m) ** 2 if camera else np.full(len(range_m), detections.range_sigma_m**2)
        across = (range_m * (BEARING_SIGMA_RAD if camera else detections.bearing_sigma_rad)) ** 2
        c, s = np.cos(angle_rad), np.sin(angle_rad)
        xy = (along - across) * c * s
        rows = [along * c * c + across * s * s, xy, xy, along * s * s + across * c * c]
        return np.stack(rows, axis=-1).reshape(-1, 2, 2)


def _turned(covariance: Floats, by_rad: float) -> Floats:
    c, s = np.cos(by_rad), np.sin(by_rad)
    turn = np.array([[c, -s], [s, c]])
    turned: Floats = turn @ covariance @ turn.T
    return turned
