"""What commands that correct the map have in common: who says so and why, and what came of it."""

import time
from collections.abc import Callable
from dataclasses import asdict
from typing import Any

import click

from trigpoint_cli.output import Answer, counted
from trigpoint_ingest.anchors import CORRECTIONS_STREAM
from trigpoint_ingest.corrections import Attribution, CorrectionReport
from trigpoint_ingest.settings import operating_user


def attribution_options(function: Callable[..., Any]) -> Callable[..., Any]:
    """A command that gets `author` (a text or None) and `reason`."""
    who = click.option("--author", metavar="NAME", help="Who says so; the user this runs as by default.")(function)
    why: Callable[..., Any] = click.option("--reason", default="", metavar="TEXT", help="Why.")(who)
    return why


def attributed(author: str | None, reason: str) -> Attribution:
    """The correction of this author (None: the user), for this reason, now."""
    return Attribution(author=operating_user() if author is None else author, reason=reason, stamp_ns=time.time_ns())


def correction_answer(report: CorrectionReport, what: str, *, past: str) -> Answer:
    """What came of a correction of so many of `what`, as "drive" "excluded"."""
    values = {
        past: [asdict(event) for event in report.appended],
        "unchanged": report.known,
        "stream": CORRECTIONS_STREAM,
        "first_number": report.first_number if report.appended else None,
    }
    line = f"{counted(len(report.appended), what)} {past}"
    if report.known:
        line += f", {report.known} already {'were' if report.known > 1 else 'was'}"
    return Answer(values, (line,))
