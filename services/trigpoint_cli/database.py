"""Which landmark database a command works with: a flag over the environment over the data directory's own file."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource

from trigpoint.configuration.building import configured
from trigpoint.configuration.given import from_toml
from trigpoint.configuration.sections import DatabaseSettings
from trigpoint.errors import InputError
from trigpoint.landmarks.opening import GEOPACKAGE, geopackage_path, geopackage_url
from trigpoint.observability.masking import without_password

CONFIGURATION_NAME = "trigpoint.toml"  # in the data directory
DATABASE_NAME = "landmarks.gpkg"
SECTION = "database"
ASKED = "trigpoint_cli.database"  # where the options' values wait for the data directory's


@dataclass(frozen=True, slots=True, kw_only=True)
class AskedDatabase:
    """What a command's options, or the environment in their place, say of the database; None: nothing."""

    url: str | None = None
    password_file: Path | None = None


EMBEDDED = AskedDatabase(url=f"{GEOPACKAGE}:")


@dataclass(frozen=True, slots=True, kw_only=True)
class _OneSection:
    """A configuration of which only the database counts."""

    database: DatabaseSettings = field(default_factory=DatabaseSettings)


def database_settings(data: Path, asked: AskedDatabase) -> DatabaseSettings:
    """The database of a data directory, its URL whole. Raises InputError, ConfigurationRefused."""
    chosen = _configured(data) if asked.url is None else DatabaseSettings(url=asked.url)
    if asked.password_file is not None:
        chosen = replace(chosen, password_file=asked.password_file)
    if geopackage_path(chosen.url) == Path():
        return DatabaseSettings(url=geopackage_url(data / DATABASE_NAME))
    return chosen


def _configured(data: Path) -> DatabaseSettings:
    file = data / CONFIGURATION_NAME
    if not file.is_file():
        return DatabaseSettings()
    section = {key: given for key, given in from_toml(file).items() if key[0] == SECTION}
    return configured(_OneSection, [section]).settings.database


def _keep(context: click.Context, parameter: click.Parameter, value: str | Path | None) -> None:
    name = str(parameter.name)
    on_command_line = context.get_parameter_source(name) is ParameterSource.COMMANDLINE
    if isinstance(value, str) and on_command_line and without_password(value) != value:
        raise InputError("--database holds a password, which every process list would show: use --password-file")
    asked = context.meta.get(ASKED, AskedDatabase())
    context.meta[ASKED] = replace(asked, **{"url" if name == "database" else name: value})


def asked_database(context: click.Context) -> AskedDatabase:
    """What the options said; a command without them gets what is configured."""
    asked: AskedDatabase = context.meta.get(ASKED, AskedDatabase())
    return asked


def database_options(function: Callable[..., Any]) -> Callable[..., Any]:
    """A command whose data directory opens the landmark database that is asked for."""
    file = click.option(
        "--password-file",
        metavar="FILE",
        type=click.Path(path_type=Path),
        envvar="TRIGPOINT_DATABASE__PASSWORD_FILE",
        is_eager=True,  # known before the data directory is
        expose_value=False,
        callback=_keep,
        help="A file that holds the database's password.",
    )(function)
    result: Callable[..., Any] = click.option(
        "--database",
        metavar="URL",
        envvar="TRIGPOINT_DATABASE__URL",
        is_eager=True,
        expose_value=False,
        callback=_keep,
        help=f"The landmark database, if not what {CONFIGURATION_NAME} in the data directory says: geopackage:PATH or "
        "postgresql+psycopg://USER@HOST/NAME.",
    )(file)
    return result
