"""What each decoder is meant to read, to begin from."""

import json
from pathlib import Path

import numpy as np
import shapely
from pyogrio import raw as ogr

from event_examples.one_each import EVENTS
from event_examples.rows import imu_rows
from fuzzed_decoders.targets import SCHEMAS
from question_examples.one_each import TILE_CHANGE, answers, questions
from trigpoint.bus.attachment import encode_attachment, encode_bundle
from trigpoint.bus.register import Register, Registration, Role, write_register
from trigpoint.events.codec import encode
from trigpoint.events.envelope import Envelope, EventIdentity
from trigpoint.events.observed import ImuMeasured, VehicleDescribed
from trigpoint.landmarks.messages import encoded_question
from trigpoint.landmarks.notices import tile_change_bytes
from trigpoint.logs.vehicle_log import write_vehicle_log
from trigpoint_vehicle.core.spool_records import SpoolChannel, channel_record, segment_record

IDENTITY = EventIdentity("veh-a", "boot-1", 7)
STAMP_NS = 1_700_000_000_000_000_000
MANIFEST = b"""
[[vehicle]]
name = "shuttle-1"
file = "shuttle1.csv"
fixes = { time = "t", lat = "lat", lon = "lon", sigma = 3 }
wheel_speeds = { time = "t", speed = { column = "v", unit = "km/h" }, steering = { column = "s", unit = "deg" } }
detections = { time = "t", range = "r", bearing = { column = "b", unit = "deg" }, kind = { value = "pole" } }
"""
CONFIGURATION = b'[fleet]\nroot = "depot"\n[ingest]\nbatch_count = 100\n[bus]\nlisten = ["tcp/127.0.0.1:0"]\n'
PCD = b"VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 1\nHEIGHT 1\nPOINTS 1\n"
PACKED = b"DATA binary_compressed\n" + bytes([7, 0, 0, 0, 12, 0, 0, 0, 3, 1, 2, 3, 4, 192, 3])
DEEP, ENDLESS = b"[" * 3000, b"9" * 5000


def seeds(folder: Path) -> dict[str, tuple[bytes, ...]]:
    """A few valid inputs of each decoder, by its name, and some with brackets or digits without end."""
    attachment = encode_attachment(IDENTITY, stamp_ns=STAMP_NS, schema_version=1)
    return {
        "event": tuple(bytes([number % len(SCHEMAS)]) + encode(event)[1] for number, event in enumerate(EVENTS)),
        "attachment": (attachment,),
        "bundle": (_bundle(attachment),),
        "key": (b"fleet/v1/veh/veh-a/up/imu", b"fleet/v1/veh/*/obs/**"),
        "question": (b"\x01151.1,-33.9,151.3,-33.8", b"\x00-33.89,151.19"),
        "question over the bus": tuple(
            bytes([number]) + encoded_question(question)[1] for number, question in enumerate(questions())
        ),
        "answer over the bus": tuple(bytes([number]) + payload for number, payload in enumerate(answers())),
        "tile's change": (tile_change_bytes(TILE_CHANGE),),
        "table manifest": (MANIFEST, b"vehicle = " + DEEP, b"vehicle = " + ENDLESS),
        "spool": (_spool(),),
        "PCD scan": (PCD + b"DATA ascii\n1 2 3\n", PCD + b"DATA binary\n" + bytes(12), PCD + PACKED),
        "log file": (_log_file(folder / "seed.mcap"),),
        "GeoJSON anchors": (_geojson(), DEEP),
        "CSV anchors": (
            b"anchor,lat,lon,sigma_m,image\na1,-33.89,151.19,0.1,west\n",
            b"id,x,y,crs\nb,1,2,EPSG:32756\n",
        ),
        "GeoPackage anchors": (_geopackage(folder / "seed.gpkg"),),
        "configuration": (CONFIGURATION, b"ingest = " + DEEP, b"ingest = " + ENDLESS),
        "configuration's words": (
            b"ingest.batch_count=100",
            b"bus.listen=['tcp/127.0.0.1:0', 'tcp/127.0.0.1:1']",
            b"INGEST__BATCH_COUNT",
            b"ingest.vehicles=" + DEEP,
            b"ingest.batch_count=" + ENDLESS,
        ),
        "register of certificates": (_register(folder / "seed.json"), DEEP),
    }


def _bundle(attachment: bytes) -> bytes:
    payload = encode(ImuMeasured(yaw_rate_radps=0.1, acceleration_x_mps2=0.0, acceleration_y_mps2=0.0))[1]
    other = encode_attachment(EventIdentity("veh-a", "boot-1", 8), stamp_ns=STAMP_NS, schema_version=1)
    head, body = encode_bundle([(attachment, payload), (other, payload)])
    return head + body


def _spool() -> bytes:
    channel = SpoolChannel("veh-a", "boot-1", SCHEMAS[3], numbered=True)
    return segment_record("veh-a", "boot-1", next_sequence=0, spooled_ns=STAMP_NS) + channel_record(0, channel)


def _log_file(path: Path) -> bytes:
    described = Envelope(EventIdentity("van", "boot-1", 0), STAMP_NS, VehicleDescribed(vehicle="van"))
    rows = [described, *imu_rows(1, 8)]
    write_vehicle_log(path, rows, vehicle="van")  # type: ignore[arg-type]  # a vehicle's own rows
    return path.read_bytes()


def _geojson() -> bytes:
    point = {"type": "Point", "coordinates": [151.19, -33.89]}
    feature = {"type": "Feature", "geometry": point, "properties": {"anchor": "a1", "sigma_m": 0.1, "image": "west"}}
    crs = {"type": "name", "properties": {"name": "EPSG:4326"}}
    return json.dumps({"type": "FeatureCollection", "crs": crs, "features": [feature]}).encode()


def _geopackage(path: Path) -> bytes:
    ogr.write(
        path,
        geometry=shapely.to_wkb(np.array([shapely.Point(151.19, -33.89)])),
        field_data=[np.array(["a1"], dtype=object)],
        fields=np.array(["anchor"], dtype=object),
        geometry_type="Point",
        crs="EPSG:4326",
        driver="GPKG",
    )
    return path.read_bytes()


def _register(path: Path) -> bytes:
    row = Registration(name="veh-a", common_name="veh-a", role=Role.VEHICLE, serial="1", not_after_s=2_000_000_000)
    write_register(path, Register((row,)))
    return path.read_bytes()
