"""What version 1 wrote is read for ever: `released_v1.txt` holds one payload of each schema as it was released."""

from pathlib import Path

import pytest

from event_examples.any_event import same_event
from event_examples.one_each import EVENTS
from trigpoint.events.codec import Event, decode, encode, event_classes

RELEASED = [line.split(" ") for line in (Path(__file__).parent / "released_v1.txt").read_text().splitlines()]
CASES = list(zip(EVENTS, RELEASED, strict=True))


@pytest.mark.parametrize(("event", "released"), CASES, ids=[name for name, _ in RELEASED])
def test_a_released_payload_is_still_read(event: Event, released: list[str]) -> None:
    name, payload = released
    assert same_event(decode(name, bytes.fromhex(payload)), event)


@pytest.mark.parametrize(("event", "released"), CASES, ids=[name for name, _ in RELEASED])
def test_an_event_is_still_written_as_released(event: Event, released: list[str]) -> None:
    name, payload = encode(event)
    assert [name, payload.hex()] == released


def test_every_class_of_events_has_a_released_payload() -> None:
    assert [type(event) for event in EVENTS] == list(event_classes())
