"""What is asked, answered and told in version 1 is read for ever: `questions_v1.txt` holds each as it was released."""

from collections.abc import Callable
from pathlib import Path

import pytest

from question_examples.one_each import (
    CHANGES,
    COVERAGE,
    LANDMARKS,
    PLACED,
    REFUSAL,
    TILE,
    TILE_CHANGE,
    VERSION_CHANGE,
    answers,
    questions,
)
from trigpoint.landmarks.messages import (
    decoded_change_answer,
    decoded_coverage_answer,
    decoded_landmark_answer,
    decoded_question,
    decoded_refusal,
    encoded_question,
)
from trigpoint.landmarks.notices import StepAssembly, decoded_version_change, tile_change_bytes

RELEASED = [line.split(" ") for line in (Path(__file__).parent / "questions_v1.txt").read_text().splitlines()]
WRITTEN = [
    *(encoded_question(question) for question in questions()),
    *(("answer", payload) for payload in answers()),
    ("tile", tile_change_bytes(TILE_CHANGE)),
]
READ: list[tuple[Callable[[bytes], object], object]] = [
    (decoded_landmark_answer, LANDMARKS),
    (decoded_change_answer, CHANGES),
    (decoded_coverage_answer, COVERAGE),
    (decoded_refusal, REFUSAL),
    (decoded_version_change, VERSION_CHANGE),
    (decoded_landmark_answer, PLACED),
]


@pytest.mark.parametrize(("written", "released"), list(zip(WRITTEN, RELEASED, strict=True)))
def test_everything_is_still_written_as_released(written: tuple[str, bytes], released: list[str]) -> None:
    assert [written[0], written[1].hex()] == released


@pytest.mark.parametrize("number", range(len(questions())))
def test_a_released_question_is_still_read(number: int) -> None:
    name, payload = RELEASED[number]
    assert decoded_question(name, bytes.fromhex(payload)) == questions()[number]


@pytest.mark.parametrize("number", range(len(READ)))
def test_a_released_answer_is_still_read(number: int) -> None:
    read, expected = READ[number]
    _, payload = RELEASED[len(questions()) + number]
    assert read(bytes.fromhex(payload)) == expected


def test_a_released_tiles_change_is_still_read() -> None:
    assembly = StepAssembly()
    assembly.keep(TILE, bytes.fromhex(RELEASED[-1][1]))
    step = assembly.step(VERSION_CHANGE, frozenset({TILE}))
    assert step is not None
    assert (step.changed, step.removed) == (TILE_CHANGE.changed, TILE_CHANGE.removed)
