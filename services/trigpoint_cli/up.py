"""`trigpoint up`: every service of one machine, each a process of its own, kept running."""

from pathlib import Path

import click

from trigpoint.observability.log_lines import log_to
from trigpoint.observability.metrics import Instruments
from trigpoint_cli.children import Child, ChildCommand, is_ready
from trigpoint_cli.output import Answer, Screen, answering
from trigpoint_cli.serve import endpoint_of
from trigpoint_cli.settings import Settings, configuration_options, configured_settings, secrets_of
from trigpoint_cli.stopping import stop_requests
from trigpoint_cli.supervisor import Machine, Supervisor


@click.command("up")
@configuration_options
@answering
def command(config: Path | None, flags: tuple[str, ...], *, screen: Screen) -> Answer:
    """Run the processes of [up] services in their order until SIGTERM or SIGINT, then stop them in reverse.

    One that ends is started again, after a wait that doubles each time; one that keeps failing shows in /healthz.
    """
    settings = configured_settings(config, flags).settings
    log_to("up", level=settings.logging.level, form=settings.logging.form, secrets=secrets_of(settings))
    supervisor = _supervisor(settings, ChildCommand(config=config, flags=flags))
    with stop_requests() as requests, endpoint_of("up", settings, supervisor):
        reason = supervisor.run(requests)
    lines = [f"stopped: {reason}", *(f"{name} had to be killed" for name in supervisor.killed)]
    return Answer({"process": "up", "stopped_by": reason, "killed": supervisor.killed}, tuple(lines))


def _supervisor(settings: Settings, command: ChildCommand) -> Supervisor:
    machine = Machine(
        start=lambda name: Child(command.words(name)), is_ready=lambda name: is_ready(name, settings.http)
    )
    return Supervisor(settings.up, machine, Instruments("up"))
