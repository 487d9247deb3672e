"""`trigpoint tokens`: who may read, label and administer the map over HTTP."""

import time
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import click

from trigpoint_cli.output import Answer, JsonObject, Screen, answering, counted
from trigpoint_landmarks.http.tokens import Scope, Token, issue_token, read_tokens, revoke_token

file_option: Callable[[Any], Any] = click.option(
    "--file",
    "path",
    required=True,
    metavar="FILE",
    type=click.Path(path_type=Path),
    help="The token file, as [web] token_file names it.",
)


@click.group("tokens", help="Tokens of the HTTP service; only their hashes are kept.")
def command() -> None:
    """Group of what can be done with tokens."""


@command.command("issue")
@click.argument("name")
@click.option("--scope", required=True, type=click.Choice([scope.value for scope in Scope]))
@file_option
@answering
def issue(name: str, scope: str, path: Path, *, screen: Screen) -> Answer:
    """Make a token for NAME and print it: this once, it is kept nowhere.

    A scope allows what those before it do: read, label, administer.
    """
    token, secret = issue_token(path, name, Scope(scope), now_s=int(time.time()))
    return Answer({**_values(token), "token": secret}, (f"{name}: {scope}; this is shown once:", secret))


@command.command("list")
@file_option
@answering
def list_command(path: Path, *, screen: Screen) -> Answer:
    """List every token ever issued, without its secret."""
    rows = read_tokens(path).rows
    in_force = sum(not row.revoked for row in rows)
    values = {"tokens": {"count": len(rows), "in_force": in_force, "items": list(map(_values, rows))}}
    return Answer(values, (*map(_line, rows), f"{counted(len(rows), 'token')}, {in_force} of them in force"))


@command.command("revoke")
@click.argument("name")
@file_option
@answering
def revoke(name: str, path: Path, *, screen: Screen) -> Answer:
    """Take the token of NAME back: a running service refuses it within a second."""
    return Answer(_values(revoke_token(path, name)), (f"{name} is revoked",))


def _values(token: Token) -> JsonObject:
    return {"name": token.name, "scope": token.scope.value, "issued_s": token.issued_s, "revoked": token.revoked}


def _line(token: Token) -> str:
    day = datetime.fromtimestamp(token.issued_s, tz=UTC).strftime("%Y-%m-%d")
    return f"{token.name}  {token.scope.value}  issued {day}{'  revoked' if token.revoked else ''}"
