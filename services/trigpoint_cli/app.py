"""The `trigpoint` command itself: its groups, and how an error ends it."""

import errno
import importlib
import json
import logging
import os
import sys
from collections.abc import Sequence

import click

from trigpoint.errors import InputError, TrigpointError
from trigpoint.observability.log_lines import logs_lines
from trigpoint.observability.masking import without_password
from trigpoint_cli.output import CommandIncomplete

OK, FAILED, BAD_INPUT = 0, 1, 2
FULL_DISK = (errno.ENOSPC, errno.EDQUOT)

COMMANDS = {
    "demo": ("trigpoint_cli.demo", "Simulate a campus and take it all the way to a map, a report and its errors."),
    "config": ("trigpoint_cli.config", "Show or check the configuration of a deployment."),
    "certs": ("trigpoint_cli.certs", "Run a private authority: who takes part in a fleet, and as what."),
    "serve": ("trigpoint_cli.serve", "Run one service as a process of its own."),
    "router": ("trigpoint_cli.router", "Run the Zenoh router of a fleet."),
    "up": ("trigpoint_cli.up", "Run every service of one machine, each a process of its own, kept running."),
    "vehicle": ("trigpoint_cli.vehicle", "Send what vehicles recorded, as the vehicles would."),
    "convert": ("trigpoint_cli.convert", "Turn recorded data into vehicles' logs."),
    "ingest": ("trigpoint_cli.ingest", "Take vehicles' logs into a data directory."),
    "anchors": ("trigpoint_cli.anchors", "Take in anchors labelled in aerial images, list them, take them back."),
    "drives": ("trigpoint_cli.drives", "Say which drives there are, and which of them the map is solved without."),
    "perceive": ("trigpoint_cli.perceive", "Find poles and building corners in lidar sweeps, and lidar odometry."),
    "build": ("trigpoint_cli.build", "Filter, solve a map version, and bring the landmark database up to it."),
    "evaluate": ("trigpoint_cli.evaluate", "Measure a map against withheld fixes, withheld anchors or truth."),
    "landmarks": ("trigpoint_cli.landmarks", "Ask for landmarks."),
    "export": ("trigpoint_cli.export", "Write the map as files of other GIS programs, or a QGIS project."),
    "ortho": ("trigpoint_cli.ortho", "Lay lidar points on the ground as rasters, and measure aerial images by them."),
    "tokens": ("trigpoint_cli.tokens", "Issue, list and revoke the HTTP service's tokens."),
    "explain": ("trigpoint_cli.explain", "Say what a landmark's place comes from."),
    "log": ("trigpoint_cli.log", "Say what a log holds, or whether it is whole."),
    "replay": ("trigpoint_cli.replay", "Rebuild every projection from the log and say whether anything differs."),
    "report": ("trigpoint_cli.report", "Write the report of the newest map version."),
}


class LazyCommands(click.Group):
    """A group whose commands are imported when they are used, so that `--help` costs nothing."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """The commands in the order of the work."""
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """The command, imported now."""
        if cmd_name not in COMMANDS:
            return None
        command = importlib.import_module(COMMANDS[cmd_name][0]).command
        assert isinstance(command, click.Command)
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """The list of commands, none of them imported."""
        with formatter.section("Commands"):
            formatter.write_dl([(name, line) for name, (_, line) in COMMANDS.items()])


@click.group(cls=LazyCommands, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="trigpoint")
@click.option("--debug", is_flag=True, help="Show the traceback of an error.")
def trigpoint(debug: bool) -> None:
    """Turn real drives into a georeferenced landmark map.

    Every command takes --json: exactly one JSON object on standard output, everything else on standard error.
    Exit status: 0 done, 2 bad usage or input, 1 failed otherwise.
    """
    logging.basicConfig(level=logging.DEBUG if debug else logging.WARNING, format="%(levelname)s %(name)s: %(message)s")
    for talkative in ("matplotlib", "PIL"):
        logging.getLogger(talkative).setLevel(logging.WARNING)


def run(words: Sequence[str]) -> int:
    """The exit status of the command with these words."""
    try:
        trigpoint.main(args=list(words), prog_name="trigpoint", standalone_mode=False)
        return OK
    except click.exceptions.NoArgsIsHelpError as error:
        click.echo(error.format_message(), err=True)
        return BAD_INPUT
    except Exception as error:
        if "--debug" in words:
            logging.getLogger(__name__).error("traceback of the error", exc_info=True)
        return _ended(error, as_json="--json" in words)


def _ended(error: Exception, *, as_json: bool) -> int:
    """The exit status of an error, after saying it in one line."""
    status, line = _status_of(error), _line_of(error)
    if logs_lines():
        logging.getLogger(__name__).critical("%s", line, extra={"exit_status": status})
    else:
        click.echo(f"trigpoint: {line}", err=True)
    if as_json:
        answer = error.answer if isinstance(error, CommandIncomplete) else {}
        try:
            click.echo(json.dumps({**answer, "error": line, "exit_status": status}))
        except BrokenPipeError:  # nobody reads any more; standard error has said it
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return status


def _status_of(error: Exception) -> int:
    if isinstance(error, InputError | click.ClickException) or _is_full_disk(error):
        return BAD_INPUT
    return FAILED


def _is_full_disk(error: BaseException | None) -> bool:
    while error is not None:
        if isinstance(error, OSError) and error.errno in FULL_DISK:
            return True
        error = error.__cause__
    return False


def _line_of(error: Exception) -> str:
    if isinstance(error, click.ClickException):
        line = error.format_message()
    elif isinstance(error, click.Abort):
        line = "interrupted"
    elif isinstance(error, TrigpointError):
        line = str(error)
    else:
        line = f"unexpected {type(error).__name__}: {error} (run with --debug for where)"
    return without_password(" ".join(line.split()))


def main() -> None:
    """The process: ends with the status of its command."""
    sys.exit(run(sys.argv[1:]))
