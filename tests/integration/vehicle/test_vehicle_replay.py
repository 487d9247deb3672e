"""`trigpoint vehicle replay`: what vehicles recorded is sent as they would have, until all of it is in the log."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from command_runs.processes import free_ports
from command_runs.running import trigpoint
from link_faults.journey import Journey, journey_in
from trigpoint.events.envelope import Envelope, EventIdentity
from trigpoint.events.observed import ImuMeasured, Observed, VehicleDescribed
from trigpoint.logs.mcap_log import McapLog
from trigpoint.logs.vehicle_log import write_vehicle_log

STEP_NS = 10_000_000
COUNT = 300  # 3 s
NOWHERE = "tcp/127.0.0.1:9"


def rows(vehicle: str) -> list[Envelope[Observed]]:
    imu = ImuMeasured(yaw_rate_radps=0.1, acceleration_x_mps2=0.0, acceleration_y_mps2=9.0)
    events: list[Observed] = [VehicleDescribed(vehicle=vehicle), *[imu] * (COUNT - 1)]
    return [
        Envelope(EventIdentity(vehicle, "recorded", number), 10**18 + number * STEP_NS, event)
        for number, event in enumerate(events)
    ]


@pytest.fixture(scope="module")
def journey(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Journey]:
    with journey_in(tmp_path_factory.mktemp("journey")) as begun:
        yield begun


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """The logs of two vehicles."""
    folder = tmp_path_factory.mktemp("recorded")
    for vehicle in ("veh-a", "veh-b"):
        write_vehicle_log(folder / f"{vehicle}.mcap", rows(vehicle), vehicle=vehicle)
    return sorted(folder.iterdir())


def stored(journey: Journey, vehicle: str) -> list[Envelope[object]]:
    log = McapLog(journey.fleet.data / "log")
    try:
        return [row.envelope for row in log.read(f"veh-{vehicle}")]
    finally:
        log.close()


def test_two_vehicles_are_replayed_at_once_in_recorded_time_over_speed(journey: Journey, logs: list[Path]) -> None:
    said = trigpoint("vehicle", "replay", *logs, "--speed", 3, "--connect", journey.link.endpoint, "--json")
    assert said.status == 0
    for vehicle in ("veh-a", "veh-b"):
        told = said.answer["vehicles"][vehicle]
        assert (told["messages"], told["acknowledged"], told["behind"]["messages"]) == (COUNT, COUNT, 0)
        assert told["wall_s"] >= 0.99  # 2.99 s recorded, at three times the speed
        assert stored(journey, vehicle) == rows(vehicle)


def test_a_replay_said_twice_changes_nothing(journey: Journey, logs: list[Path], tmp_path: Path) -> None:
    words = ("--speed", 0, "--connect", journey.link.endpoint, "--spool", tmp_path, "--json")
    assert trigpoint("vehicle", "replay", logs[0], *words).status == 0
    assert trigpoint("vehicle", "replay", logs[0], *words).status == 0
    assert stored(journey, "veh-a") == rows("veh-a")
    assert list(tmp_path.glob("*/*.spool")) == []


def test_the_fleet_s_configuration_says_where_it_is(journey: Journey, logs: list[Path]) -> None:
    said = trigpoint("vehicle", "replay", logs[1], "--speed", 0, "--config", journey.fleet.config, "--json")
    assert said.status == 0
    assert stored(journey, "veh-b") == rows("veh-b")


def test_the_whole_messages_of_a_damaged_log_are_sent_and_the_damage_ends_it_with_status_2(
    journey: Journey, logs: list[Path], tmp_path: Path
) -> None:
    damaged = tmp_path / "damaged.mcap"
    damaged.write_bytes(logs[0].read_bytes()[:-20])
    said = trigpoint("vehicle", "replay", damaged, "--speed", 0, "--connect", journey.link.endpoint, "--json")
    assert said.status == 2
    assert said.answer["vehicles"]["veh-a"]["acknowledged"] == COUNT
    assert "damaged.mcap" in said.answer["error"]


def test_what_nobody_acknowledges_stays_in_the_spool_and_ends_with_status_1(logs: list[Path], tmp_path: Path) -> None:
    nobody = f"tcp/127.0.0.1:{free_ports(1)[0]}"
    words = ("--speed", 0, "--connect", nobody, "--spool", tmp_path, "--give-up-after-s", 0.5, "--json")
    said = trigpoint("vehicle", "replay", logs[0], *words)
    assert said.status == 1
    assert f"messages not acknowledged: {COUNT} of veh-a; they stay in {tmp_path}" in said.answer["error"]
    assert len(list((tmp_path / "veh-a").glob("*.spool"))) == 1


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("missing.mcap", "--connect", NOWHERE), "missing.mcap: no such file"),
        (("{log}",), "--connect ENDPOINT or --config FILE is needed"),
        (("{log}", "--connect", NOWHERE, "--speed", "-1"), "--speed -1: 0 or more"),
        (("{log}", "--connect", NOWHERE, "--speed", "nan"), "--speed nan: 0 or more"),
    ],
    ids=["no file", "no fleet", "backwards", "no number"],
)
def test_bad_usage_ends_with_status_2_and_says_why(words: tuple[str, ...], told: str, logs: list[Path]) -> None:
    said = trigpoint("vehicle", "replay", *(word.format(log=logs[0]) for word in words), "--json")
    assert said.status == 2
    assert told in said.answer["error"]
