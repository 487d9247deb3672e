"""`trigpoint config`: the configuration as a deployment's processes see it."""

from pathlib import Path

import click

from trigpoint.configuration.showing import shown_values, toml_lines
from trigpoint.observability.tracing import require_tracing
from trigpoint_cli.output import Answer, JsonObject, Screen, answering
from trigpoint_cli.settings import configuration_options, configured_settings, secrets_of


@click.group("config", help="Show or check the configuration of a deployment.")
def command() -> None:
    """Group of what can be asked of a configuration."""


@command.command("show")
@configuration_options
@answering
def show(config: Path | None, flags: tuple[str, ...], *, screen: Screen) -> Answer:
    """Print every value with where it comes from: a flag, the environment, the file, or the default.

    Passwords are masked. The lines are TOML themselves.
    """
    shown = list(shown_values(configured_settings(config, flags)))
    values: JsonObject = {}
    for one in shown:
        table = values
        for name in one.path[:-1]:
            table = table.setdefault(name, {})
        table[one.path[-1]] = {"value": one.value, "origin": one.origin}
    return Answer({"sections": values}, tuple(toml_lines(iter(shown))))


@command.command("check")
@configuration_options
@answering
def check(config: Path | None, flags: tuple[str, ...], *, screen: Screen) -> Answer:
    """Say whether the services would start with this configuration; everything that is wrong is named."""
    found = configured_settings(config, flags)
    secrets_of(found.settings)  # its files can be read
    if found.settings.tracing.endpoint is not None:
        require_tracing()
    given = len(found.given)
    return Answer({"valid": True, "given": given}, (f"the configuration is valid; {given} values are set",))
