"""The fold takes one event at a time: late fixes, rest, and a batch's own answers."""

import math

import numpy as np
import pytest

from driven_paths.examples import FRAME, Course, driven
from trigpoint.geodesy.poses import Pose2
from trigpoint.geodesy.positions import MapPosition
from trigpoint.geodesy.projection import map_points_from_wgs84
from trigpoint_filtering.core.estimator import GnssNoise, rested
from trigpoint_filtering.core.following import Track, gnss_noise
from trigpoint_filtering.core.initialisation import Alignment, placed, prior_calibration
from trigpoint_filtering.core.motion import TURN_BIAS, Geometry, MotionStep, TurnSource
from trigpoint_filtering.core.online import after_fix, after_imu, after_wheel
from trigpoint_filtering.core.track import begun_track, filter_drive
from trigpoint_filtering.settings import FilterSettings

SETTINGS = FilterSettings()
RUN = driven(Course(duration_s=60.0))
GEOMETRY = Geometry(2.5, 0.0, 1.5, 0.4, 1.0)


def followed(*, fix_delay_s: float = 0.0) -> tuple[Track, list[str]]:
    """The track after the drive, one event at a time, and the reasons; fixes after 40 s come late."""
    track, drive, reasons = begun_track(RUN.drive, FRAME, SETTINGS), RUN.drive, list[str]()
    fix_m = map_points_from_wgs84(drive.fixes.lat_deg, drive.fixes.lon_deg, FRAME)
    delay_ns = np.where(RUN.fix_s() > 40.0, round(fix_delay_s * 1e9), 0)
    wheels = [(int(stamp), 0, row) for row, stamp in enumerate(drive.wheels.stamp_ns)]
    imu = [(int(stamp), 1, row) for row, stamp in enumerate(drive.imu.stamp_ns)]
    fixes = [(int(stamp), 2, row) for row, stamp in enumerate(drive.fixes.stamp_ns + delay_ns)]
    for stamp_ns, kind, row in sorted(wheels + imu + fixes):
        if kind == 0:
            speed = float(drive.wheels.speed_mps[row])
            track = after_wheel(track, speed, steering_rad=math.nan, yaw_rate_radps=math.nan, stamp_ns=stamp_ns)
        elif kind == 1:
            track = after_imu(track, float(drive.imu.yaw_rate_radps[row]), stamp_ns=stamp_ns)
        else:
            position = MapPosition(float(fix_m[row, 0]), float(fix_m[row, 1]))
            measured_ns = int(drive.fixes.stamp_ns[row])
            track = after_fix(track, position, stamp_ns=measured_ns, sigma_m=2.0, sequence=row)
            reasons.append(track.verdict.reason if track.verdict else "")
    return track, reasons


def test_event_by_event_ends_where_the_batch_ends() -> None:
    track, reasons = followed()
    batch = filter_drive(RUN.drive, FRAME, SETTINGS)
    assert track.hypothesis is not None
    np.testing.assert_array_equal(track.hypothesis.belief.mean[:2], batch.pose[-1, :2])
    assert reasons == [verdict.reason for verdict in batch.judged]


def test_a_fix_half_a_second_late_is_taken_to_where_the_vehicle_is_now() -> None:
    track, reasons = followed(fix_delay_s=0.5)
    # Taken as it comes it would lie 3 m behind, outside a gate of some 3 m half of the time.
    assert reasons[-15:].count("inside gate") >= 13
    assert track.hypothesis is not None
    assert np.hypot(*(track.hypothesis.belief.mean[:2] - RUN.pose[-1, :2])) < 2.0


def test_a_fix_seconds_late_is_left_out_with_the_reason() -> None:
    _, reasons = followed(fix_delay_s=3.0)
    assert set(reasons[-15:-3]) == {"late"}  # the last three come after the wheels have ended


def test_a_minute_at_rest_shows_the_gyroscopes_bias() -> None:
    prior = prior_calibration(TurnSource.IMU, GEOMETRY, antenna_sigma_m=0.1)
    still = Pose2(0.0, 0.0, 0.0)
    belief = placed(prior, still, Alignment(still, 0.1, 1.0, 6), GnssNoise(1.0, 2.0, 120.0))
    for _ in range(600):
        belief = rested(belief, MotionStep(0.1, 0.0, 0.006, TurnSource.IMU, standing=True))
    assert belief.mean[TURN_BIAS] == pytest.approx(-0.006, abs=1e-4)
    assert math.sqrt(belief.covariance[TURN_BIAS, TURN_BIAS]) == pytest.approx(1e-3 / math.sqrt(60.0), rel=0.05)


@pytest.mark.parametrize(
    ("declared_m", "total_m"), [(0.01, 1.0), (3.0, 3.0), (500.0, 10.0), (math.nan, 2.0), (0.0, 2.0)]
)
def test_a_receivers_own_sigma_is_floored_capped_or_replaced(declared_m: float, total_m: float) -> None:
    noise = gnss_noise(declared_m, SETTINGS)
    assert math.hypot(noise.white_sigma_m, noise.bias_sigma_m) == pytest.approx(total_m)


def test_the_belief_is_never_older_than_a_step() -> None:
    track, _ = followed()
    assert 0 <= int(RUN.drive.wheels.stamp_ns[-1]) - track.believed_ns < SETTINGS.max_step_s * 1e9
    assert track.refusal == ""
