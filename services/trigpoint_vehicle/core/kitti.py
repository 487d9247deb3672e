"""A KITTI raw drive (Geiger et al. 2013): an HDL-64 on a car's roof, and an OXTS RT 3003 with GNSS and IMU."""

import math
from collections.abc import Sequence
from datetime import UTC, datetime

import numpy as np
from numpy.typing import NDArray

from trigpoint.errors import InputError
from trigpoint.events.observed import GnssFixReceived, ImuMeasured, VehicleDescribed, WheelSpeedMeasured
from trigpoint.events.scanned import PointsScanned
from trigpoint_vehicle.core.mountings import Mounting, quaternion_of_rotation
from trigpoint_vehicle.core.recording import Timed
from trigpoint_vehicle.core.returns import returned_points
from trigpoint_vehicle.core.text_tables import SourceText

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

VEHICLE, SENSOR = "kitti", "velodyne"
OXTS_COLUMNS = 30
LAT, LON, HEIGHT, YAW, FORWARD_SPEED, FORWARD_ACCELERATION, LEFT_ACCELERATION, YAW_RATE, SIGMA = (
    0,
    1,
    2,
    5,
    8,
    14,
    15,
    22,
    23,
)
IMU_HEIGHT_M = 0.93  # of the OXTS over the road, from the published drawing of the car
NS_PER_S = 1_000_000_000
FIRST_STAMP_NS = 946_684_800_000_000_000  # 2000-01-01T00:00:00Z stands for scan 0 where the files hold no time
STEP_NS = NS_PER_S // 10  # 10 Hz nominal
STEP_SHARE_MAX = 0.01  # 1-sigma of a measured step, of itself
BIN_COLUMNS = 4  # x, y, z, reflectance
RING_LEAST = 16  # points: where the azimuth trembles about straight ahead, it falls more often
NEW_RING_RAD = math.pi  # the azimuth falls by more than this where the next laser's turn begins

# Base: on the road under the OXTS, which stands over the rear axle; it reports its own position.
DESCRIBED = VehicleDescribed(vehicle=VEHICLE, software="trigpoint convert kitti")


def even_stamps_ns(rows: Floats) -> Ints:
    """The stamps (n,) of scans 0, 1, … where the files hold none, of the rows (n, 30) of their OXTS: evenly spaced.

    They are spaced so that the yaw rate adds up to the yaw (least squares over the steps): 10 Hz is nominal, the lidar
    turns as it likes. Where the drive turns too little to tell the spacing within 1 %, the nominal one is taken. On
    drive 0005 it is 103.6 ms; the lidar's odometry says 103.8 ms by the OXTS's speed and 103.0 ms by its yaw rate.
    """
    return FIRST_STAMP_NS + _step_ns(rows[:, YAW], rows[:, YAW_RATE]) * np.arange(len(rows), dtype=np.int64)


def _step_ns(yaw_rad: Floats, yaw_rate_radps: Floats) -> int:
    turned_rad, rate_radps = np.diff(np.unwrap(yaw_rad)), 0.5 * (yaw_rate_radps[1:] + yaw_rate_radps[:-1])
    squares = float((rate_radps**2).sum())
    if len(turned_rad) < 2 or not squares > 0.0:
        return STEP_NS
    step_s = float((turned_rad * rate_radps).sum()) / squares
    sigma_s = math.sqrt(float(((turned_rad - step_s * rate_radps) ** 2).sum()) / (len(turned_rad) - 1) / squares)
    step_ns = round(step_s * NS_PER_S)
    is_told = sigma_s <= STEP_SHARE_MAX * step_s and STEP_NS // 2 <= step_ns <= 2 * STEP_NS
    return step_ns if is_told else STEP_NS


def written_stamps_ns(source: SourceText) -> Ints:
    """The stamps (n,) of a timestamps.txt, one a line with up to nine decimals, taken as UTC; -1 for an empty line.

    Raises InputError naming file, line and text.
    """
    lines = source.text.removesuffix("\n").split("\n") if source.text else []
    return np.array([_stamp_ns(source.name, number, line.strip()) for number, line in enumerate(lines, 1)], dtype=int)


def _stamp_ns(name: str, number: int, text: str) -> int:
    if not text:
        return -1
    whole, _, decimals = text.partition(".")
    try:
        second = datetime.fromisoformat(whole).replace(tzinfo=UTC)
        return int(second.timestamp()) * NS_PER_S + int(decimals.ljust(9, "0")[:9] or "0")
    except ValueError as error:
        raise InputError(f"{name}, line {number}: {text!r} is no time: {error}") from None


def oxts_rows(source: SourceText) -> Floats:
    """The numbers (n, 30) of an OXTS file, a row a line. Raises InputError naming file and row."""
    rows = []
    for number, line in enumerate(source.text.splitlines(), start=1):
        cells = line.split()
        if len(cells) != OXTS_COLUMNS:
            raise InputError(f"{source.name}, row {number}: {len(cells)} numbers, expected {OXTS_COLUMNS}")
        try:
            rows.append([float(cell) for cell in cells])
        except ValueError as error:
            raise InputError(f"{source.name}, row {number}: {error}") from None
    return np.array(rows).reshape(-1, OXTS_COLUMNS)


def oxts_events(rows: Floats, stamps_ns: Ints) -> list[Timed]:
    """What the OXTS says in each row (n, 30): a fix with its sigma, yaw rate and level accelerations, forward speed."""
    timed: list[Timed] = []
    for stamp_ns, row in zip(stamps_ns.tolist(), rows.tolist(), strict=True):
        inertial = ImuMeasured(
            yaw_rate_radps=row[YAW_RATE],
            acceleration_x_mps2=row[FORWARD_ACCELERATION],
            acceleration_y_mps2=row[LEFT_ACCELERATION],
        )
        wheel = WheelSpeedMeasured(speed_mps=row[FORWARD_SPEED], steering_rad=math.nan, yaw_rate_radps=math.nan)
        fix = GnssFixReceived(lat_deg=row[LAT], lon_deg=row[LON], height_m=row[HEIGHT], sigma_m=row[SIGMA])
        timed += [(stamp_ns, wheel), (stamp_ns, inertial), (stamp_ns, fix)]
    return timed


def lidar_mounting(source: SourceText) -> Mounting:
    """The lidar in the base frame, from `Tr_imu_velo` (3, 4) or from `R` and `T` as calib_imu_to_velo.txt has them,
    which take coordinates of the OXTS into the lidar's. Raises InputError.
    """
    named = {name.rstrip(":"): cells for name, *cells in map(str.split, source.text.splitlines()) if cells}
    if "Tr_imu_velo" in named:
        T_velo_imu = _matrix(source.name, "Tr_imu_velo", named["Tr_imu_velo"], (3, 4))
        R_velo_imu, t_velo_imu = T_velo_imu[:, :3], T_velo_imu[:, 3]
    elif {"R", "T"} <= named.keys():
        R_velo_imu = _matrix(source.name, "R", named["R"], (3, 3))
        t_velo_imu = _matrix(source.name, "T", named["T"], (3,))
    else:
        raise InputError(f"{source.name}: neither Tr_imu_velo nor R and T; there are {', '.join(named) or 'no names'}")
    position_m = -R_velo_imu.T @ t_velo_imu + np.array([0.0, 0.0, IMU_HEIGHT_M])
    return Mounting(position_m, quaternion_of_rotation(R_velo_imu.T))


def _matrix(source: str, name: str, cells: Sequence[str], shape: tuple[int, ...]) -> Floats:
    try:
        return np.array([float(cell) for cell in cells]).reshape(shape)
    except ValueError as error:
        raise InputError(f"{source}: {name} is no matrix of shape {shape}: {error}") from None


def bin_points(name: str, data: bytes) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Points (n, 3) and reflectances (n,) of a velodyne .bin file. Raises InputError for a length that does not fit."""
    size = BIN_COLUMNS * np.dtype(np.float32).itemsize
    if len(data) % size:
        raise InputError(f"{name}: {len(data)} bytes are no whole number of points of {size} bytes")
    rows = np.frombuffer(data, dtype="<f4").reshape(-1, BIN_COLUMNS)
    return np.ascontiguousarray(rows[:, :3]), np.ascontiguousarray(rows[:, 3])


def turn_ns(stamps_ns: Ints) -> int:
    """How long one turn takes: the median step between scans that follow one another."""
    steps_ns = np.diff(stamps_ns)[(stamps_ns[1:] > 0) & (stamps_ns[:-1] > 0)]
    return int(np.median(steps_ns)) if len(steps_ns) else STEP_NS


def kitti_sweep(
    point_m: NDArray[np.float32], intensity: NDArray[np.float32], mounting: Mounting, *, turn_ns: int
) -> PointsScanned:
    """A scan (n, 3) as a sweep whose stamp is when the lidar looked ahead.

    The lidar turns clockwise seen from above and a turn begins behind the car, so that offsets go from -half a turn on
    the left of the rear to half a turn on its right. Found on drive 0005 itself: where a surface behind the car goes
    over that seam, its right side is farther away by 0.10 s of the car's speed. The lasers look up to 9 degrees to
    either side of the head, which leaves 2.5 ms.
    """
    returned_m = returned_points(point_m)
    azimuth_rad = np.arctan2(returned_m[:, 1], returned_m[:, 0], dtype=np.float64)
    offset_ns = np.rint(np.nan_to_num(-azimuth_rad / (2.0 * math.pi) * turn_ns)).astype(np.int32)
    return PointsScanned(
        sensor=SENSOR,
        sensor_position_m=mounting.position_m,
        sensor_orientation=mounting.orientation,
        point_m=returned_m,
        intensity=intensity,
        offset_ns=offset_ns,
        ring=laser_of_point(azimuth_rad),
    )


def laser_of_point(azimuth_rad: Floats) -> NDArray[np.uint16]:
    """The laser (n,) of each point, from 0, the topmost: the files hold one laser's turn after the other, each from
    straight ahead to the left. A point without azimuth (NaN) has the laser of the one before it."""
    seen = np.flatnonzero(np.isfinite(azimuth_rad))
    begins = np.flatnonzero(np.diff(azimuth_rad[seen] % (2.0 * math.pi)) < -NEW_RING_RAD) + 1
    begins = begins[(np.diff(begins, prepend=-RING_LEAST) >= RING_LEAST) & (len(seen) - begins >= RING_LEAST)]
    is_first = np.zeros(len(azimuth_rad), dtype=np.bool_)
    is_first[seen[begins]] = True
    ring = np.cumsum(is_first)
    return np.minimum(ring, np.iinfo(np.uint16).max).astype(np.uint16)
