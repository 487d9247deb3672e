"""`trigpoint serve SERVICE`: one service as a process of its own, until it is told to stop."""

import importlib
import logging
import os
import sys
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from pathlib import Path

import click

from trigpoint.observability.endpoint import Endpoint, EndpointSettings, Health
from trigpoint.observability.log_lines import log_to
from trigpoint.observability.metrics import Instruments
from trigpoint.observability.running import Service
from trigpoint.observability.tracing import Spans, TracesSettings, opened_spans
from trigpoint_cli.output import Answer, Screen, answering
from trigpoint_cli.served import ServedService
from trigpoint_cli.settings import Settings, configuration_options, configured_settings, secrets_of
from trigpoint_cli.stopping import StopRequests, stop_requests

SERVICES = ("ingest", "filtering", "perception", "optimisation", "landmarks", "answers", "http")
LOOK_S = 0.2  # between two looks whether the service still works
STUCK = 1  # exit status of a process that could not finish in time

Opener = Callable[[Settings, Instruments], AbstractContextManager[Service]]

logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True, kw_only=True)
class Ran:
    """A process that was told to stop, and why."""

    process: str
    reason: str

    def answer(self) -> Answer:
        """What the command says."""
        return Answer({"process": self.process, "stopped_by": self.reason}, (f"{self.process}: {self.reason}",))


@click.command("serve")
@click.argument("service", type=click.Choice(SERVICES))
@configuration_options
@click.option("--until-input-ends", is_flag=True, help="Stop when standard input ends, as it does with its writer.")
@answering
def command(
    service: str, config: Path | None, flags: tuple[str, ...], *, until_input_ends: bool, screen: Screen
) -> Answer:
    """Run one service until SIGTERM or SIGINT; what it began is finished first, within [serve] stop_limit_s."""
    settings = configured_settings(config, flags).settings
    return run_process(service, settings, until_input_ends=until_input_ends).answer()


def run_process(process: str, settings: Settings, *, until_input_ends: bool) -> Ran:
    """The process's service ran until it was told to stop. Raises what ended it otherwise."""
    log_to(process, level=settings.logging.level, form=settings.logging.form, secrets=secrets_of(settings))
    with stop_requests(with_standard_input=until_input_ends) as requests, _spans(process, settings) as spans:
        instruments = Instruments(process, heard=spans)
        opener: Opener = importlib.import_module(f"trigpoint_cli.serving.{process}").opened
        limit_s = settings.serve.silence_limit_s
        served = ServedService(lambda: opener(settings, instruments), instruments, silence_limit_s=limit_s)
        reason = serve_until_stopped(served, settings, requests)
    logger.info("stopped", extra={"reason": reason})
    return Ran(process=process, reason=reason)


def _spans(process: str, settings: Settings) -> AbstractContextManager[Spans | None]:
    """Who hears of the work that is timed, if the configuration names an endpoint. Raises InputError."""
    tracing = settings.tracing
    if tracing.endpoint is None:
        return nullcontext()
    chosen = TracesSettings(endpoint=tracing.endpoint, sampled_share=tracing.sampled_share, timeout_s=tracing.timeout_s)
    return opened_spans(process, chosen)


def serve_until_stopped(served: ServedService, settings: Settings, requests: StopRequests) -> str:
    """Why the service was told to stop. Raises what ended it otherwise."""
    reason = None
    with endpoint_of(served.name, settings, served):
        served.start()
        while served.is_alive() and reason is None:
            reason = requests.wait(LOOK_S)
            served.look()
        if reason is not None:
            _stop(served, reason, settings.serve.stop_limit_s)
    if served.error is not None:
        raise served.error
    return reason or "its own end"


def endpoint_of(process: str, settings: Settings, health: Health) -> AbstractContextManager[object]:
    """The process's HTTP endpoint while it is open, if the configuration wants one. Raises ServiceError."""
    http = settings.http
    if not http.enabled:
        return nullcontext()
    chosen = EndpointSettings(
        host=http.host,
        port=http.ports()[process],
        parallel_limit=http.parallel_limit,
        request_timeout_s=http.request_timeout_s,
    )
    endpoint = Endpoint(chosen, health)
    logger.info("answering", extra={"address": endpoint.address})
    return endpoint


def _stop(served: ServedService, reason: str, limit_s: float) -> None:
    """The service stopped; a process whose service does not finish in time ends here and now."""
    logger.info("stopping", extra={"reason": reason, "limit_s": limit_s})
    if served.stop(limit_s):
        return
    logger.error("not finished within %g s: the process ends; whoever takes over goes on from the log", limit_s)
    sys.stderr.flush()
    os._exit(STUCK)
