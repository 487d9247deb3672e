"""`python -m link_faults.vehicle`: a vehicle's program, which writes down what its publisher took before it goes on."""

import argparse
import os
import signal
import sys
import threading
import time
from pathlib import Path

from trigpoint.bus.zenoh_bus import ZenohSettings
from trigpoint.events.observed import GnssFixReceived, ImuMeasured, Observed, VehicleDescribed, WheelSpeedMeasured
from trigpoint_vehicle.publisher import VehiclePublisher
from trigpoint_vehicle.settings import VehicleSettings


def measured(number: int) -> Observed:
    """The kinds in turns: each has a key of its own, and messages of one number behind the other go by several."""
    if number % 10 == 0:
        return GnssFixReceived(lat_deg=-33.9 + 1e-9 * number, lon_deg=151.2, height_m=20.0, sigma_m=3.0)
    if number % 2:
        return ImuMeasured(yaw_rate_radps=0.0, acceleration_x_mps2=1e-6 * number, acceleration_y_mps2=0.0)
    return WheelSpeedMeasured(speed_mps=1e-6 * number, steering_rad=0.0, yaw_rate_radps=0.0)


def main() -> None:
    """Sends at a rate until SIGTERM, then until everything is acknowledged; killed, it just ends."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--vehicle", required=True)
    parser.add_argument("--spool", type=Path, required=True)
    parser.add_argument("--connect", required=True)
    parser.add_argument("--rate-hz", type=float, required=True)
    parser.add_argument("--taken", type=Path, required=True)
    options = parser.parse_args()
    told: list[int] = []  # signals; an event set by a handler would wait for the thread it interrupted
    signal.signal(signal.SIGTERM, lambda number, _: told.append(number))
    pause = threading.Event()
    taken = os.open(options.taken, os.O_WRONLY | os.O_CREAT | os.O_APPEND)
    bus = ZenohSettings(connect=(options.connect,))
    with VehiclePublisher(options.vehicle, options.spool, bus, VehicleSettings()) as publisher:
        identity = publisher.describe(VehicleDescribed(vehicle=options.vehicle), stamp_ns=time.time_ns())
        began_s, count = time.monotonic(), 0
        while not told:
            os.write(taken, f"{identity.boot_id} {identity.sequence}\n".encode())
            count += 1
            pause.wait(max(began_s + count / options.rate_hz - time.monotonic(), 0.0))
            identity = publisher.send(measured(count), stamp_ns=time.time_ns())
        os.write(taken, f"{identity.boot_id} {identity.sequence}\n".encode())
        sys.exit(0 if publisher.flush(300.0) else 1)


if __name__ == "__main__":
    main()
