"""No bytes crash a decoder, and no malformed message costs a valid one. The figure of group security does it longer."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from fuzzed_decoders.guided_runs import guided
from fuzzed_decoders.property_runs import fed
from fuzzed_decoders.seeds import seeds
from fuzzed_decoders.streams import ingested_stream
from fuzzed_decoders.targets import Decoder, decoders, fast_folder

NAMES = [one.name for one in decoders(Path())]
CHANGED = 150  # of each decoder
LED = 1500


@dataclass(frozen=True, slots=True)
class Fuzzed:
    decoders: dict[str, Decoder]
    seeds: dict[str, tuple[bytes, ...]]


@pytest.fixture(scope="module")
def fuzzed() -> Iterator[Fuzzed]:
    with fast_folder() as folder:
        yield Fuzzed({one.name: one for one in decoders(Path(folder))}, seeds(Path(folder)))


@pytest.mark.parametrize("name", NAMES)
def test_a_valid_input_is_taken(fuzzed: Fuzzed, name: str) -> None:
    assert fuzzed.decoders[name].takes(fuzzed.seeds[name][0])


@pytest.mark.parametrize("name", NAMES)
def test_a_changed_input_is_taken_or_refused_and_nothing_else(fuzzed: Fuzzed, name: str) -> None:
    inputs, taken = fed(fuzzed.decoders[name], fuzzed.seeds[name], count=CHANGED, seed=1)
    assert inputs >= CHANGED > 0
    assert taken <= inputs


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("table manifest", b"vehicle = " + b"[" * 3000),
        ("table manifest", b"vehicle = " + b"9" * 5000),
        ("configuration", b"ingest = " + b"[" * 3000),
        ("configuration", b"ingest = " + b"9" * 5000),
        ("configuration's words", b"ingest.batch_count=" + b"[" * 3000),
        ("configuration's words", b"ingest.batch_count=" + b"9" * 5000),
        ("register of certificates", b"[" * 3000),
        ("GeoJSON anchors", b"[" * 3000),
    ],
)
def test_brackets_and_digits_without_end_are_refused(fuzzed: Fuzzed, name: str, text: bytes) -> None:
    assert not fuzzed.decoders[name].takes(text)


def test_inputs_led_by_coverage_crash_nothing() -> None:
    run = guided("all", runs=LED, seed=1)
    assert run.crash == ""
    assert run.inputs >= LED


@pytest.mark.parametrize("seed", [1, 2])
def test_every_valid_event_among_malformed_ones_is_in_the_log_once_and_in_order(seed: int) -> None:
    tally = ingested_stream(count=600, seed=seed)
    assert (tally.lost, tally.doubled, tally.disordered, tally.malformed_kept) == (0, 0, 0, 0)
    assert 300 < tally.valid < tally.sent
