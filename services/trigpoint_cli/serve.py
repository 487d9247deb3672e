"""`trigpoint serve SERVICE`: one service as a process of its own, until it is told to stop."""

import importlib
import logging
import os
import sys
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path

import click

from trigpoint.observability.endpoint import Endpoint, EndpointSettings, Health
from trigpoint.observability.log_lines import log_to
from trigpoint.observability.metrics import Instruments
from trigpoint.observability.running import Service
from trigpoint_cli.served import ServedService
from trigpoint_cli.settings import Settings, configuration_options, configured_settings
from trigpoint_cli.stopping import StopRequests, stop_requests

SERVICES = {
    "ingest": "trigpoint_cli.serving.ingest",
    "filtering": "trigpoint_cli.serving.filtering",
    "optimisation": "trigpoint_cli.serving.optimisation",
    "landmarks": "trigpoint_cli.serving.landmarks",
}
LOOK_S = 0.2  # between two looks whether the service still works
STUCK = 1  # exit status of a process that could not finish in time

Opener = Callable[[Settings, Instruments], AbstractContextManager[Service]]

logger = logging.getLogger(__name__)


@click.command("serve")
@click.argument("service", type=click.Choice(sorted(SERVICES)))
@configuration_options
@click.option("--until-input-ends", is_flag=True, help="Stop when standard input ends, as it does with its writer.")
def command(service: str, config: Path | None, flags: tuple[str, ...], *, until_input_ends: bool) -> None:
    """Run one service until SIGTERM or SIGINT; what it began is finished first, within [serve] stop_limit_s."""
    settings = configured_settings(config, flags).settings
    log_to(service, level=settings.logging.level, form=settings.logging.form)
    instruments = Instruments(service)
    with stop_requests(with_standard_input=until_input_ends) as requests:
        opener = _opener(service)
        served = ServedService(lambda: opener(settings, instruments), instruments)
        serve_until_stopped(served, settings, requests)


def serve_until_stopped(served: ServedService, settings: Settings, requests: StopRequests) -> None:
    """The service runs until there is a request to stop. Raises what ended it otherwise."""
    with endpoint_of(served.name, settings, served):
        served.start()
        while served.is_alive():
            reason = requests.wait(LOOK_S)
            if reason is not None:
                _stop(served, reason, settings.serve.stop_limit_s)
                break
    if served.error is not None:
        raise served.error
    logger.info("stopped", extra={"stage": served.stage.value})


def endpoint_of(process: str, settings: Settings, health: Health) -> AbstractContextManager[object]:
    """The process's HTTP endpoint while it is open, if the configuration wants one."""
    http = settings.http
    if not http.enabled:
        return nullcontext()
    endpoint = Endpoint(
        EndpointSettings(
            host=http.host,
            port=http.ports()[process],
            parallel_limit=http.parallel_limit,
            request_timeout_s=http.request_timeout_s,
        ),
        health,
    )
    logger.info("answering", extra={"address": endpoint.address})
    return endpoint


def _opener(service: str) -> Opener:
    opener: Opener = importlib.import_module(SERVICES[service]).opened
    return opener


def _stop(served: ServedService, reason: str, limit_s: float) -> None:
    """The service stopped; a process whose service does not finish in time ends here and now."""
    logger.info("stopping", extra={"reason": reason, "limit_s": limit_s})
    if served.stop(limit_s):
        return
    logger.error("not finished within %g s: the process ends; whoever takes over goes on from the log", limit_s)
    sys.stderr.flush()
    os._exit(STUCK)
