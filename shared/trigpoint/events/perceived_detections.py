"""What perception found, as the landmark sensor would have detected it."""

import math

from trigpoint.events.observed import LandmarkDetection, LandmarksDetected, VehicleDescribed
from trigpoint.events.perceived import LandmarksPerceived


def detected_in(perceived: LandmarksPerceived, described: VehicleDescribed) -> LandmarksDetected:
    """The landmarks of a sweep by range and bearing from the vehicle's landmark sensor, without a signature."""
    yaw_rad = described.landmark_sensor_yaw_rad
    detections = []
    for landmark in perceived.landmarks:
        x_m, y_m = landmark.x_m - described.landmark_sensor_x_m, landmark.y_m - described.landmark_sensor_y_m
        bearing_rad = math.remainder(math.atan2(y_m, x_m) - yaw_rad, math.tau)
        detections.append(LandmarkDetection(math.hypot(x_m, y_m), bearing_rad, landmark.kind, "", landmark.diameter_m))
    return LandmarksDetected(detections=tuple(detections))
