"""`trigpoint router`: the fleet's Zenoh router, until it is told to stop."""

from pathlib import Path

import click

from trigpoint_cli.output import Answer, Screen, answering
from trigpoint_cli.serve import run_process
from trigpoint_cli.settings import configuration_options, configured_settings


@click.command("router")
@configuration_options
@click.option("--until-input-ends", is_flag=True, help="Stop when standard input ends, as it does with its writer.")
@answering
def command(config: Path | None, flags: tuple[str, ...], *, until_input_ends: bool, screen: Screen) -> Answer:
    """Run a Zenoh router with the endpoints of [router] until SIGTERM or SIGINT."""
    return run_process(
        "router", configured_settings(config, flags).settings, until_input_ends=until_input_ends
    ).answer()
