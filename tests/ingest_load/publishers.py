"""`python -m ingest_load.publishers ENDPOINT FOLDER`: vehicles that publish until standard input ends.

Then everything is flushed, and one JSON object on standard output says of each vehicle its boot, how many messages it
sent, and whether all were acknowledged.
"""

import argparse
import json
import sys
import threading
from contextlib import ExitStack
from pathlib import Path

from trigpoint.bus.zenoh_bus import ZenohSettings
from trigpoint.events.observed import ImuMeasured, VehicleDescribed
from trigpoint_vehicle.publisher import VehiclePublisher

T0_NS = 1_700_000_000_000_000_000
STEP_NS = 5_000_000
FLUSH_LONGEST_S = 120.0


def publish(publishers: list[VehiclePublisher], stop: threading.Event, *, interval_s: float, at_once: int) -> int:
    """How many messages each vehicle sent: a description, then inertial samples, `at_once` every interval."""
    for publisher in publishers:
        described = VehicleDescribed(
            vehicle=publisher.vehicle,
            declared_crs="EPSG:32756",
            declared_origin_easting_m=332_000.0,
            declared_origin_northing_m=6_249_000.0,
        )
        publisher.describe(described, stamp_ns=T0_NS)
    count = 1
    while not stop.wait(interval_s):
        for sequence in range(count, count + at_once):
            sample = ImuMeasured(yaw_rate_radps=sequence * 1e-6, acceleration_x_mps2=0.1, acceleration_y_mps2=0.2)
            for publisher in publishers:
                publisher.send(sample, stamp_ns=T0_NS + sequence * STEP_NS)
        count += at_once
    return count


def _stop_at_end_of_input(stop: threading.Event) -> None:
    sys.stdin.read()
    stop.set()


def main(words: list[str]) -> int:
    """Publishes until told to stop, then says what became of it."""
    parser = argparse.ArgumentParser()
    parser.add_argument("endpoint")
    parser.add_argument("folder", type=Path)
    parser.add_argument("--vehicles", type=int, default=10)
    parser.add_argument("--interval", type=float, default=0.05, help="seconds")
    parser.add_argument("--at-once", type=int, default=10)
    options = parser.parse_args(words)
    stop = threading.Event()
    threading.Thread(target=_stop_at_end_of_input, args=(stop,), daemon=True).start()
    bus = ZenohSettings(connect=(options.endpoint,), mode="client")
    with ExitStack() as stack:
        publishers = [
            stack.enter_context(VehiclePublisher(f"veh-{number}", options.folder / f"veh-{number}", bus))
            for number in range(options.vehicles)
        ]
        count = publish(publishers, stop, interval_s=options.interval, at_once=options.at_once)
        answer = {
            publisher.vehicle: {
                "boot_id": publisher.boot_id,
                "sent": count,
                "all_acknowledged": publisher.flush(FLUSH_LONGEST_S),
                "resent": publisher.sent.resent,
            }
            for publisher in publishers
        }
    sys.stdout.write(json.dumps(answer) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
