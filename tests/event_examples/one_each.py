"""One event of each class, as a service would say it."""

import math

import numpy as np

from trigpoint.events.codec import Event
from trigpoint.events.corrected import AnchorLabelled, AnchorRetracted, DriveExcluded, DriveIncluded
from trigpoint.events.envelope import Envelope, EventIdentity
from trigpoint.events.estimated import FixJudged, GateAlarmed, PoseFiltered
from trigpoint.events.mapped import (
    AnchorAssociated,
    ImageOffsetSolved,
    LabelGainSolved,
    LandmarkSolved,
    MapSolved,
    OdometryCorrected,
    TrajectorySolved,
)
from trigpoint.events.observed import (
    EventRefused,
    GnssFixReceived,
    ImuMeasured,
    LandmarkDetection,
    LandmarksDetected,
    MapFramePinned,
    VehicleDescribed,
    WheelPairMeasured,
    WheelSpeedMeasured,
)
from trigpoint.events.scanned import PointsScanned

EVENTS: tuple[Event, ...] = (
    VehicleDescribed(
        vehicle="van",
        wheelbase_m=2.83,
        antenna_x_m=3.77,
        landmark_sensor_model="camera",
        declared_crs="EPSG:32756",
        software="logger 3",
    ),
    WheelSpeedMeasured(speed_mps=5.0, steering_rad=0.1, yaw_rate_radps=math.nan),
    WheelPairMeasured(left_mps=1.0, right_mps=1.1),
    ImuMeasured(yaw_rate_radps=0.02, acceleration_x_mps2=math.nan, acceleration_y_mps2=-0.3),
    GnssFixReceived(lat_deg=-33.888, lon_deg=151.192, height_m=31.5, sigma_m=1.7),
    LandmarksDetected(
        detections=(
            LandmarkDetection(12.5, -0.4, "tree", "", 0.31),
            LandmarkDetection(3.25, 1.5, "vehicle", "car", math.nan),
        )
    ),
    PointsScanned(
        sensor="roof",
        sensor_position_m=np.array([0.4, -0.1, 1.9]),
        sensor_orientation=np.array([0.0, 0.0, 0.6, 0.8]),
        point_m=np.array([[4.0, 0.5, -1.9], [math.nan, math.nan, math.nan]], dtype=np.float32),
        intensity=np.array([17.0, 0.0], dtype=np.float32),
        offset_ns=np.array([-50_000_000, 49_950_000], dtype=np.int32),
        ring=np.array([0, 15], dtype=np.uint16),
    ),
    EventRefused(
        source="van", reason="not finite", detail="lat_deg nan", schema_name="x.Y", payload=b"\x00\xff\x89MCAP"
    ),
    MapFramePinned(crs="EPSG:32756", origin_easting_m=332_000.0, origin_northing_m=6_248_000.0, declared_by="van"),
    AnchorLabelled(
        anchor="a1",
        lat_deg=-33.888,
        lon_deg=151.192,
        sigma_m=0.1,
        image="west",
        image_sigma_m=0.35,
        kind="pole",
        signature="",
        source_crs="EPSG:7856",
        operation="GDA2020 to WGS 84 (2)",
    ),
    AnchorRetracted(anchor="a1", image="west", author="surveyor", reason="the pole was moved"),
    DriveExcluded(vehicle="van", boot_id="boot-1", author="operator", reason="antenna came loose"),
    DriveIncluded(vehicle="van", boot_id="boot-1", author="operator", reason="it had not"),
    FixJudged(
        vehicle="van",
        boot_id="boot-1",
        fix_sequence=17,
        accepted=False,
        reason="outside gate",
        nis=12.5,
        limit=5.99,
        innovation_x_m=4.0,
        innovation_y_m=-7.0,
    ),
    PoseFiltered(
        vehicle="van",
        boot_id="boot-1",
        x_m=1.5,
        y_m=-2.5,
        heading_rad=0.7,
        speed_mps=6.0,
        covariance=np.arange(9.0).reshape(3, 3),
    ),
    GateAlarmed(vehicle="van", boot_id="boot-1", reason="rejects everything", duration_s=31.0),
    MapSolved(
        map_version=3,
        method="anchored",
        settings_json='{"sigma_m": 5.0}',
        inputs=(("veh-van", 1200), ("corrections", 50)),
        landmark_count=250,
        anchor_count=50,
        wall_s=12.5,
    ),
    TrajectorySolved(
        map_version=3,
        vehicle="van",
        boot_id="boot-1",
        stamp_ns=np.array([1, 2], dtype=np.int64),
        pose=np.arange(6.0).reshape(2, 3),
        covariance=np.arange(18.0).reshape(2, 3, 3),
        calibration=(("antenna_x_m", 3.77, 0.1), ("speed_scale", 1.01, 0.002)),
    ),
    LandmarkSolved(
        map_version=3,
        landmark="lm-7",
        kind="pole",
        signature="",
        position_m=np.array([10.5, -3.25]),
        covariance_m2=np.array([[0.04, 0.01], [0.01, 0.09]]),
        observation_count=12,
        vehicles=("van", "car"),
        first_seen_ns=1_700_000_000_000_000_000,
        last_seen_ns=1_700_000_100_000_000_000,
        anchors=("a1",),
        observations=(("van", "boot-1", 40), ("car", "boot-9", 2)),
    ),
    AnchorAssociated(map_version=3, anchor="a1", landmark="lm-7", reason="", residual_m=np.array([0.1, -0.2])),
    ImageOffsetSolved(map_version=3, image="west", offset_m=np.array([0.3, 0.1]), covariance_m2=np.diag([0.01, 0.02])),
    LabelGainSolved(
        map_version=3,
        image="west",
        landmarks=("lm-7", "lm-9"),
        expected_m2=np.array([[0.05, 0.01, 0.11], [0.04, 0.0, 0.04]]),
        shared_m4=np.array([[0.02, 0.001, 0.03], [0.01, 0.0, 0.01]]),
    ),
    OdometryCorrected(
        vehicle="van",
        boot_id="boot-1",
        map_version=3,
        T_map_odom=np.array([10.0, -4.0, 0.2]),
        covariance=np.diag([0.04, 0.05, 0.001]),
    ),
)
ONE_OF_EACH: tuple[Envelope[Event], ...] = tuple(
    Envelope(EventIdentity("van", "boot-1", sequence), 1_700_000_000_000_000_000 + sequence, event)
    for sequence, event in enumerate(EVENTS)
)
