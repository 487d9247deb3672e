"""Services as processes: they start, say how they are, stop in order and in time, and leave nobody behind."""

import json
import os
import signal
import socket
import urllib.request
from pathlib import Path

import pytest

from command_runs.processes import Fleet, Process, fleet_in, free_ports, runs, trigpoint_process, wait_until
from trigpoint_cli.serve import SERVICES

TWO = '[up]\nservices = ["router", "ingest"]\nbackoff_first_s = 0.05\nstop_limit_s = 1.0\nfailing_count = 3\n'


@pytest.fixture
def fleet(tmp_path: Path) -> Fleet:
    return fleet_in(tmp_path, TWO)


def pids(fleet: Fleet) -> dict[str, int]:
    return {name: one["pid"] for name, one in fleet.told("up", "/healthz")["processes"].items()}


def messages(process: Process, text: str) -> list[str]:
    """The services that logged a message, in order."""
    return [line["service"] for line in process.logged() if line["message"] == text]


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_service_that_is_told_to_stop_ends_with_status_0_and_says_why(fleet: Fleet, number: signal.Signals) -> None:
    with trigpoint_process(fleet.folder, "router", "--config", fleet.config, "--json") as router:
        fleet.wait_ready("router")
        router.send(number)
        assert router.ended() == 0
        assert json.loads(router.out)["stopped_by"] == number.name


def test_a_service_stops_when_whoever_holds_its_input_is_gone(fleet: Fleet) -> None:
    with trigpoint_process(fleet.folder, "router", "--config", fleet.config, "--until-input-ends") as router:
        fleet.wait_ready("router")
        assert router.popen.stdin is not None
        router.popen.stdin.close()
        assert router.ended() == 0


def test_a_service_is_alive_before_it_is_ready(fleet: Fleet) -> None:
    with trigpoint_process(fleet.folder, "serve", "ingest", "--config", fleet.config) as ingest:
        wait_until(lambda: fleet.page("ingest", "/healthz")[0] == 200, "ingest alive")
        assert fleet.page("ingest", "/readyz")[0] == 503  # no router: it waits for one
        with trigpoint_process(fleet.folder, "router", "--config", fleet.config):
            fleet.wait_ready("ingest")
            assert ingest.stop() == 0


def test_a_service_whose_port_is_taken_says_so_and_ends(fleet: Fleet) -> None:
    with (
        socket.create_server(("127.0.0.1", fleet.ports["router"])),
        trigpoint_process(fleet.folder, "router", "--config", fleet.config) as router,
    ):
        assert router.ended() == 1
    assert f"127.0.0.1:{fleet.ports['router']}: Address already in use" in router.err


def test_services_start_in_their_order_and_stop_in_reverse(fleet: Fleet) -> None:
    with trigpoint_process(fleet.folder, "up", "--config", fleet.config, "--json") as up:
        fleet.wait_ready("up")
        running = pids(fleet)
        assert up.stop() == 0
        assert messages(up, "answering") == ["up", "router", "ingest"]
        assert messages(up, "stopped") == ["ingest", "router"]
        assert json.loads(up.out)["killed"] == []
    assert [name for name, pid in running.items() if runs(pid)] == []


def test_without_being_told_which_all_services_run_and_the_map_is_served_on_loopback(tmp_path: Path) -> None:
    (port,) = free_ports(1)
    fleet = fleet_in(tmp_path, f"[web]\nport = {port}\n")
    with trigpoint_process(fleet.folder, "up", "--config", fleet.config) as up:
        fleet.wait_ready("up")
        assert set(pids(fleet)) == {*SERVICES, "router"}
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/versions", timeout=10.0) as answer:
            assert json.load(answer)["versions"] == []
        assert up.stop() == 0


def test_a_service_that_was_killed_is_started_again_and_counted(fleet: Fleet) -> None:
    with trigpoint_process(fleet.folder, "up", "--config", fleet.config) as up:
        fleet.wait_ready("up")
        killed = pids(fleet)["ingest"]
        os.kill(killed, signal.SIGKILL)
        wait_until(lambda: pids(fleet)["ingest"] not in (None, killed), "another ingest")
        fleet.wait_ready("up")
        assert 'trigpoint_restarts_total{name="ingest"} 1.0' in fleet.page("up", "/metrics")[1]
        assert fleet.told("up", "/healthz")["processes"]["ingest"]["last_status"] == -signal.SIGKILL
        assert up.stop() == 0


def test_no_service_outlives_a_supervisor_that_was_killed(fleet: Fleet) -> None:
    with trigpoint_process(fleet.folder, "up", "--config", fleet.config) as up:
        fleet.wait_ready("up")
        left = pids(fleet)
        up.send(signal.SIGKILL)
        up.ended()
        wait_until(lambda: not any(runs(pid) for pid in left.values()), f"{left} gone")


def test_a_service_that_does_not_stop_in_time_is_killed_and_named(fleet: Fleet) -> None:
    with trigpoint_process(fleet.folder, "up", "--config", fleet.config, "--json") as up:
        fleet.wait_ready("up")
        stuck = pids(fleet)["ingest"]
        os.kill(stuck, signal.SIGSTOP)
        assert up.stop() == 0
        assert json.loads(up.out)["killed"] == ["ingest"]
    assert not runs(stuck)


def test_a_service_that_keeps_failing_shows_in_the_health_of_up_and_the_others_go_on(fleet: Fleet) -> None:
    fleet.data.write_text("a file, where ingest needs a folder", encoding="utf-8")
    with trigpoint_process(fleet.folder, "up", "--config", fleet.config) as up:
        wait_until(lambda: fleet.page("up", "/healthz")[0] == 503, "up not well")
        told = fleet.told("up", "/healthz")
        assert told["failing"] == ["ingest"]
        assert told["processes"]["ingest"]["last_status"] == 2
        assert fleet.is_ready("router")
        assert up.stop() == 0
    reasons = [line["message"] for line in up.logged() if line["level"] == "CRITICAL"]
    assert f"{fleet.data}/log: no log can be opened here" in reasons[0]
