"""The Victoria Park drive (Guivant and Nebot, 2001): a car with a front laser that finds trees, Sydney."""

import math

import numpy as np
from numpy.typing import NDArray

from trigpoint.events.observed import (
    GnssFixReceived,
    LandmarkDetection,
    VehicleDescribed,
    WheelSpeedMeasured,
)
from trigpoint.events.truth import Truth
from trigpoint.geodesy.positions import GridPosition
from trigpoint_vehicle.core.recording import Conversion, Timed, boot_id_of, recording_of
from trigpoint_vehicle.core.source_frames import local_frame_on_grid, wgs84_from_source
from trigpoint_vehicle.core.sweep_events import sweeps_of
from trigpoint_vehicle.core.text_tables import WHITESPACE, SourceText, TextTable, text_table

Floats = NDArray[np.float64]

GPS, INPUTS, MEASUREMENTS = "gps.dat", "inputs.dat", "measurements.dat"
FILES = (GPS, INPUTS, MEASUREMENTS)
VEHICLE = "utecar"
CRS = "EPSG:32756"
ORIGIN = GridPosition(332_940.0, 6_248_560.0)  # approximate: the park is known, the local frame's place in it is not
FIRST_STAMP_NS = 946_684_800_000_000_000  # 2000-01-01T00:00:00Z stands for second 0: the files hold no date
SECOND_NS = 1_000_000_000
AHEAD_IN_FILE_RAD = 0.5 * math.pi

# Geometry as published with the data, but for the antenna: its place is the one that fits GPS to dead reckoning over
# stretches of 40 s (published figures disagree with one another).
DESCRIBED = VehicleDescribed(
    vehicle=VEHICLE,
    wheelbase_m=2.83,
    speed_wheel_y_m=0.76,
    antenna_x_m=3.77,
    antenna_y_m=0.62,
    landmark_sensor_x_m=3.78,
    landmark_sensor_y_m=0.50,
    landmark_sensor_range_m=80.0,
    declared_crs=CRS,
    declared_origin_easting_m=ORIGIN.easting_m,
    declared_origin_northing_m=ORIGIN.northing_m,
    software="trigpoint convert victoria-park",
)


def _stamps(table: TextTable) -> list[int]:
    stamps: list[int] = table.stamps_ns("t", unit_ns=SECOND_NS, epoch_ns=FIRST_STAMP_NS).tolist()
    return stamps


def _fixes(source: SourceText) -> list[Timed]:
    table = text_table(source, columns=("t", "east", "north"), delimiter=WHITESPACE)
    frame = local_frame_on_grid(CRS, ORIGIN)
    lat_deg, lon_deg = wgs84_from_source(table.numbers("east"), table.numbers("north"), frame)
    return [
        (stamp, GnssFixReceived(lat_deg=lat, lon_deg=lon, height_m=math.nan, sigma_m=math.nan))
        for stamp, lat, lon in zip(_stamps(table), lat_deg.tolist(), lon_deg.tolist(), strict=True)
    ]


def _wheels(source: SourceText) -> list[Timed]:
    table = text_table(source, columns=("t", "speed", "steering"), delimiter=WHITESPACE)
    speed, steering = table.numbers("speed").tolist(), table.numbers("steering").tolist()
    return [
        (stamp, WheelSpeedMeasured(speed_mps=v, steering_rad=angle, yaw_rate_radps=math.nan))
        for stamp, v, angle in zip(_stamps(table), speed, steering, strict=True)
    ]


def _sweeps(source: SourceText) -> list[Timed]:
    table = text_table(source, columns=("t", "range", "bearing", "diameter"), delimiter=WHITESPACE)
    bearing = table.numbers("bearing") - AHEAD_IN_FILE_RAD
    columns = zip(table.numbers("range").tolist(), bearing.tolist(), table.numbers("diameter").tolist(), strict=True)
    return sweeps_of(_stamps(table), [LandmarkDetection(r, angle, "pole", "", width) for r, angle, width in columns])


def victoria_park(gps: SourceText, inputs: SourceText, measurements: SourceText) -> Conversion:
    """The drive's events; there is no truth and no anchor. Raises InputError naming file, row and value."""
    timed = _fixes(gps) + _wheels(inputs) + _sweeps(measurements)
    boot_id = boot_id_of(*(source.text.encode() for source in (gps, inputs, measurements)))
    return Conversion(recordings=(recording_of(DESCRIBED, timed, boot_id=boot_id),), truth=Truth(), anchors=())
