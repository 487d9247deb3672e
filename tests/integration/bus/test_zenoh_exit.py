"""A process that used the bus ends."""

import subprocess
import sys

PROGRAM = """
import sys
from trigpoint.bus.zenoh_bus import ZenohBus, ZenohSettings
with ZenohBus(ZenohSettings()) as bus:
    subscription = bus.subscribe("t/**")
    if sys.argv[1] == "fails":
        raise SystemExit(3)
"""


def test_an_open_subscription_does_not_hold_the_interpreter_back() -> None:
    finished = subprocess.run([sys.executable, "-c", PROGRAM, "works"], timeout=30.0, check=False)
    assert finished.returncode == 0


def test_an_error_with_a_subscription_open_still_ends_the_process() -> None:
    finished = subprocess.run([sys.executable, "-c", PROGRAM, "fails"], timeout=30.0, check=False)
    assert finished.returncode == 3
