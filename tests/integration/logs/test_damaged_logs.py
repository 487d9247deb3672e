"""The damage campaign in short; the whole one is `make figures ONLY=faults`."""

import sys
from pathlib import Path

import pytest

from damaged_logs.campaign import Case, cases, sealed_log

PROGRAM = (str(Path(sys.executable).with_name("trigpoint")),)


@pytest.fixture(scope="module")
def outcomes(tmp_path_factory: pytest.TempPathFactory) -> list[Case]:
    """60 bit flips and 20 truncations, 3 of them through processes of their own."""
    folder = tmp_path_factory.mktemp("damaged")
    log = sealed_log(folder / "whole")
    flips = cases(log, folder, kind="flip", seeds=range(2000, 2060), program=PROGRAM)
    return [*flips, *cases(log, folder, kind="cut", seeds=range(2000, 2020), program=PROGRAM)]


def test_every_damage_is_found(outcomes: list[Case]) -> None:
    assert [case.damage for case in outcomes if not case.found] == []


def test_every_recovered_log_is_opened_and_verified(outcomes: list[Case]) -> None:
    assert [case.damage for case in outcomes if not case.recovered] == []


def test_every_event_of_an_untouched_chunk_comes_back(outcomes: list[Case]) -> None:
    assert [case.damage for case in outcomes if case.unread] == []


def test_no_event_comes_back_as_another(outcomes: list[Case]) -> None:
    assert [case.damage for case in outcomes if case.wrong] == []
