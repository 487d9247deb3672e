"""`python -m link_faults.acknowledger ENDPOINT`: hears everything vehicles send and acknowledges it, keeping nothing.

So that a publisher's own rate is measured, and not that of the ingest behind it.
"""

import sys

from trigpoint.bus.ports import Bus, BusMessage, BusRun, Subscription
from trigpoint.bus.zenoh_bus import ZenohBus, ZenohSettings
from trigpoint.events.envelope import EventIdentity
from trigpoint.events.seen import SeenSequences
from trigpoint.events.uplink import ACKNOWLEDGEMENT_SCHEMA, acknowledgement_key, uplink_expression

WAIT_S = 1.0
BARE_KEY = "bare"  # heard, and dropped once a queue is full


def main(endpoint: str) -> None:
    """Acknowledges until it is killed."""
    with ZenohBus(ZenohSettings(listen=(endpoint,))) as bus:
        bus.subscribe(BARE_KEY)
        subscription = bus.subscribe(uplink_expression())
        seen = SeenSequences()
        while True:
            acknowledge(bus, seen, heard(subscription, seen))


def heard(subscription: Subscription, seen: SeenSequences) -> set[tuple[str, str]]:
    """The drives of which something came, all that waited now taken note of."""
    drives = set()
    run: BusRun | None = subscription.receive_run(WAIT_S)
    while run is not None:
        rows = run.run
        for sequence in rows.sequences.tolist():
            seen.add(EventIdentity(rows.source, rows.boot_id, sequence))
        drives.add((rows.source, rows.boot_id))
        run = subscription.receive_run(0.0)
    return drives


def acknowledge(bus: Bus, seen: SeenSequences, drives: set[tuple[str, str]]) -> None:
    """Each drive told up to which number everything came."""
    for source, boot_id in drives:
        (start, stop), *_ = seen.ranges(source, boot_id)
        identity = EventIdentity(source, boot_id, stop - 1 if start == 0 else -1)
        key = acknowledgement_key(source)
        bus.publish(BusMessage(key=key, schema_name=ACKNOWLEDGEMENT_SCHEMA, payload=b"", identity=identity, stamp_ns=0))


if __name__ == "__main__":
    main(sys.argv[1])
