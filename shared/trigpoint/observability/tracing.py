"""Spans of what a service measured, sent by OTLP over HTTP; OpenTelemetry's one home."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.util import find_spec
from typing import TYPE_CHECKING

from trigpoint.errors import InputError

if TYPE_CHECKING:
    from opentelemetry.sdk.trace import TracerProvider

NS_PER_S = 1_000_000_000
EXTRA = "trigpoint[tracing]"

Spans = Callable[[str, float], None]
"""Hears of a work's name and the seconds it took, as it ends."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TracesSettings:
    """Where spans go, which share of them, and how long sending may take."""

    endpoint: str
    sampled_share: float = 1.0
    timeout_s: float = 5.0


def require_tracing() -> None:
    """Nothing, if OpenTelemetry is installed. Raises InputError, which says how to install it."""
    if find_spec("opentelemetry") is None or find_spec("opentelemetry.sdk") is None:
        raise InputError(f"tracing needs OpenTelemetry: pip install '{EXTRA}'")


@contextmanager
def opened_spans(service: str, settings: TracesSettings) -> Iterator[Spans]:
    """Spans of one service while it is open; those not yet sent are sent at the end, within the timeout.

    Raises InputError where OpenTelemetry is not installed.
    """
    require_tracing()
    provider = _provider(service, settings)
    tracer = provider.get_tracer("trigpoint")

    def heard(name: str, duration_s: float) -> None:
        ended_ns = time.time_ns()
        span = tracer.start_span(name, start_time=ended_ns - round(duration_s * NS_PER_S))
        span.end(ended_ns)

    try:
        yield heard
    finally:
        provider.force_flush(round(1e3 * settings.timeout_s))
        provider.shutdown()


def _provider(service: str, settings: TracesSettings) -> "TracerProvider":
    from opentelemetry.exporter.otlp.proto.http.trace_exporter import OTLPSpanExporter
    from opentelemetry.sdk.resources import Resource
    from opentelemetry.sdk.trace import TracerProvider
    from opentelemetry.sdk.trace.export import BatchSpanProcessor
    from opentelemetry.sdk.trace.sampling import TraceIdRatioBased

    provider = TracerProvider(
        resource=Resource.create({"service.name": f"trigpoint-{service}"}),
        sampler=TraceIdRatioBased(settings.sampled_share),
        shutdown_on_exit=False,
    )
    exporter = OTLPSpanExporter(endpoint=settings.endpoint, timeout=settings.timeout_s)
    provider.add_span_processor(BatchSpanProcessor(exporter))
    return provider
