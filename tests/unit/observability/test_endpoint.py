"""What a process answers over HTTP."""

import http.client
import json
import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest

from trigpoint.errors import ServiceError
from trigpoint.observability.endpoint import Endpoint, EndpointSettings, Status
from trigpoint.observability.metrics import Instruments

SETTINGS = EndpointSettings(host="127.0.0.1", port=0, parallel_limit=2, request_timeout_s=0.3)


class Patient:
    """A process that can be alive and ready or not; its numbers wait until it is let go."""

    def __init__(self, *, well: bool = True) -> None:
        self.well = well
        self.asked, self.let_go = threading.Semaphore(0), threading.Event()
        self.instruments = Instruments("patient")

    def alive(self) -> Status:
        return self.well, {"why": "told so"}

    def ready(self) -> Status:
        return self.well, {}

    def exposition(self) -> bytes:
        self.asked.release()
        self.let_go.wait(10.0)
        return self.instruments.exposition()


@contextmanager
def answering(patient: Patient) -> Iterator[tuple[str, int]]:
    with Endpoint(SETTINGS, patient) as endpoint:
        host, port = endpoint.address.removeprefix("http://").split(":")
        try:
            yield host, int(port)
        finally:
            patient.let_go.set()


def asked(address: tuple[str, int], path: str, *, method: str = "GET") -> tuple[int, bytes]:
    connection = http.client.HTTPConnection(*address, timeout=5.0)
    connection.request(method, path)
    answer = connection.getresponse()
    found = answer.status, answer.read()
    connection.close()
    return found


@pytest.mark.parametrize(("path", "well", "status"), [("/healthz", True, 200), ("/healthz", False, 503),
                                                      ("/readyz", True, 200), ("/readyz", False, 503)])  # fmt: skip
def test_health_is_told_by_status_and_in_words(path: str, well: bool, status: int) -> None:
    with answering(Patient(well=well)) as address:
        found, body = asked(address, path)
    told: Any = json.loads(body)
    assert (found, told["ok"]) == (status, well)


def test_metrics_are_text_for_prometheus() -> None:
    patient = Patient()
    patient.instruments.accepted.labels("veh-a").inc(7)
    patient.let_go.set()
    with answering(patient) as address:
        _, body = asked(address, "/metrics")
    assert b'trigpoint_accepted_total{vehicle="veh-a"} 7.0' in body


@pytest.mark.parametrize(("method", "path", "status"), [("GET", "/", 404), ("GET", "/../etc/passwd", 404),
                                                        ("POST", "/healthz", 501), ("HEAD", "/healthz", 200),
                                                        ("GET", "/healthz?verbose", 200)])  # fmt: skip
def test_only_its_pages_are_there_to_be_read(method: str, path: str, status: int) -> None:
    with answering(Patient()) as address:
        assert asked(address, path, method=method)[0] == status


def test_more_connections_than_allowed_are_closed_unanswered_and_the_next_is_answered() -> None:
    patient = Patient()
    with answering(patient) as address:
        first, second = (threading.Thread(target=asked, args=(address, "/metrics")) for _ in range(2))
        first.start()
        second.start()
        assert patient.asked.acquire(timeout=5.0)
        assert patient.asked.acquire(timeout=5.0)
        with pytest.raises((http.client.RemoteDisconnected, ConnectionError)):
            asked(address, "/healthz")
        patient.let_go.set()
        first.join()
        second.join()
        assert answered_again(address)


def answered_again(address: tuple[str, int]) -> bool:
    """True; a thread that has answered gives its place back a moment later."""
    while True:
        try:
            return asked(address, "/healthz")[0] == 200
        except (http.client.RemoteDisconnected, ConnectionError):
            continue


def test_a_connection_that_stays_silent_is_closed() -> None:
    with answering(Patient()) as address, socket.create_connection(address, timeout=5.0) as connection:
        connection.sendall(b"GET /healthz HTT")
        assert connection.recv(100) == b""


def test_a_request_line_without_end_is_refused() -> None:
    with answering(Patient()) as address, socket.create_connection(address, timeout=5.0) as connection:
        connection.sendall(b"GET /" + b"a" * 70_000)
        assert b" 414 " in connection.recv(100)


def test_a_port_that_is_taken_is_named() -> None:
    with answering(Patient()) as (host, port), pytest.raises(ServiceError, match=f"{host}:{port}: Address already"):
        Endpoint(EndpointSettings(host=host, port=port), Patient())


def test_an_address_of_ipv6_is_one_too() -> None:
    with Endpoint(EndpointSettings(host="::1", port=0), Patient()) as endpoint:
        assert endpoint.address.startswith("http://[::1]:")
