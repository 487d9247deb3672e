"""Spans of what is timed, received by an endpoint of our own."""

import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, HTTPServer

import pytest

from trigpoint.errors import InputError
from trigpoint.observability.metrics import Instruments
from trigpoint.observability.tracing import TracesSettings, opened_spans

pytest.importorskip("opentelemetry.sdk", reason="the extra `tracing` is not installed")


class _Collector(HTTPServer):
    bodies: list[bytes]


class _Handler(BaseHTTPRequestHandler):
    server: _Collector

    def do_POST(self) -> None:
        self.server.bodies.append(self.rfile.read(int(self.headers["Content-Length"])))
        self.send_response(200)
        self.send_header("Content-Length", "0")
        self.end_headers()

    def log_message(self, format: str, *arguments: object) -> None:
        pass


@contextmanager
def collecting() -> Iterator[tuple[str, list[bytes]]]:
    with _Collector(("127.0.0.1", 0), _Handler) as server:
        server.bodies = []
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        try:
            yield f"http://127.0.0.1:{server.server_port}/v1/traces", server.bodies
        finally:
            server.shutdown()
            thread.join()


def sent(share: float) -> list[tuple[str, float]]:
    """Name and seconds of the spans that arrive of one fsync of half a second."""
    from opentelemetry.proto.collector.trace.v1.trace_service_pb2 import ExportTraceServiceRequest

    with collecting() as (endpoint, bodies):
        with opened_spans("ingest", TracesSettings(endpoint=endpoint, sampled_share=share)) as spans:
            Instruments("ingest", heard=spans).fsync_seconds.observe(0.5)
        requests = [ExportTraceServiceRequest.FromString(body) for body in bodies]
    found = [
        span for one in requests for two in one.resource_spans for three in two.scope_spans for span in three.spans
    ]
    return [(span.name, (span.end_time_unix_nano - span.start_time_unix_nano) / 1e9) for span in found]


def test_what_is_timed_becomes_a_span_as_long_as_it_took() -> None:
    assert sent(1.0) == [("fsync", 0.5)]


def test_what_is_not_sampled_is_not_sent() -> None:
    assert sent(0.0) == []


def test_an_endpoint_nobody_answers_at_does_not_hold_the_end_back() -> None:
    settings = TracesSettings(endpoint="http://127.0.0.1:9/v1/traces", timeout_s=0.5)
    with opened_spans("ingest", settings) as spans:
        spans("fsync", 0.1)


def test_without_opentelemetry_it_is_said_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "opentelemetry", None)
    with (
        pytest.raises(InputError, match=r"pip install 'trigpoint\[tracing\]'"),
        opened_spans("ingest", TracesSettings(endpoint="http://127.0.0.1:9")),
    ):
        pass
