"""What the vehicles of a load test send: described drives of sweeps, each payload of a wanted size."""

import math
import random
from collections.abc import Iterator

import numpy as np

from trigpoint.bus.ports import BusRun
from trigpoint.events.codec import encode
from trigpoint.events.observed import LandmarkDetection, LandmarksDetected, VehicleDescribed
from trigpoint.events.runs import EncodedRun
from trigpoint.events.uplink import uplink_key

T0_NS = 1_700_000_000_000_000_000
STEP_NS = 1_000_000
BOOT = "boot-1"
DETECTION_BYTES = 35  # of kind "pole", without signature
TOGETHER_COUNT = 256  # as the vehicles' publisher sends them
DETECTIONS_MOST = 9000  # in a sweep
VARIETY = 64  # different payloads of a vehicle


def sweep_of(size_bytes: int, die: random.Random) -> bytes:
    """A valid sweep of that many bytes, 40 at least, filled up with signatures."""
    count = min(size_bytes // DETECTION_BYTES, DETECTIONS_MOST)
    spare = size_bytes - count * DETECTION_BYTES
    each, more = divmod(spare, count)
    lengths = [each - 2 + (index < more) if each > 2 else 0 for index in range(count)]
    if each <= 2:  # a signature takes two bytes more than it is long
        lengths[0] = max(spare - 2, 0)
    detections = tuple(
        LandmarkDetection(die.uniform(1, 80), die.uniform(-3, 3), "pole", "s" * length, die.uniform(0.1, 0.6))
        for length in lengths
    )
    return encode(LandmarksDetected(detections=detections))[1]


def drive_runs(vehicle: str, *, count: int, size_bytes: int, seed: int, together: int) -> Iterator[BusRun]:
    """A drive of `count` messages as its vehicle sends it: a description, then sweeps, `together` at a time."""
    described = VehicleDescribed(
        vehicle=vehicle,
        declared_crs="EPSG:32756",
        declared_origin_easting_m=332_000.0,
        declared_origin_northing_m=6_249_000.0,
    )
    schema, payload = encode(described)
    yield _bus_run(vehicle, VehicleDescribed, schema, 0, [payload])
    die = random.Random(seed)
    schema = encode(LandmarksDetected(detections=()))[0]
    variety = [sweep_of(size_bytes, die) for _ in range(VARIETY if size_bytes < 10_000 else 4)]
    for first in range(1, count, together):
        payloads = [variety[(first + index) % len(variety)] for index in range(min(together, count - first))]
        yield _bus_run(vehicle, LandmarksDetected, schema, first, payloads)


def _bus_run(vehicle: str, kind: type, schema: str, first: int, payloads: list[bytes]) -> BusRun:
    sequences = np.arange(first, first + len(payloads), dtype=np.int64)
    run = EncodedRun(
        source=vehicle,
        boot_id=BOOT,
        schemas=(schema,),
        schema_of_row=np.zeros(len(payloads), dtype=np.int64),
        sequences=sequences,
        stamps_ns=T0_NS + sequences * STEP_NS,
        payloads=payloads,
    )
    return BusRun(uplink_key(vehicle, kind), 1, run)


def together_of(size_bytes: int) -> int:
    """How many messages of that size a publisher hands over at a time."""
    return max(1, min(TOGETHER_COUNT, math.floor(1024 * 1024 / size_bytes)))
