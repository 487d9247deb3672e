"""What a deployment is told: every section of its configuration, from flags, the environment and a file."""

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any
from urllib.parse import unquote, urlsplit

import click

from trigpoint.bus.router import RouterSettings
from trigpoint.bus.zenoh_bus import ZenohSettings
from trigpoint.configuration.building import Configured, configured
from trigpoint.configuration.given import Layer, from_environment, from_flags, from_toml
from trigpoint.configuration.limits import SetElsewhere
from trigpoint.configuration.sections import (
    DatabaseSettings,
    FleetSettings,
    HttpSettings,
    LoggingSettings,
    LogSettings,
    ServeSettings,
    TracingSettings,
    UpSettings,
)
from trigpoint.errors import InputError
from trigpoint.observability.log_lines import Secrets
from trigpoint_filtering.settings import FilterSettings
from trigpoint_ingest.settings import IngestSettings
from trigpoint_landmarks.http.settings import WebSettings
from trigpoint_landmarks.settings import AnswerSettings, LandmarkSettings
from trigpoint_optimisation.settings import SolveSettings
from trigpoint_vehicle.settings import VehicleSettings

ROUTER_ENDPOINT = "tcp/127.0.0.1:7447"
ROUTER = RouterSettings(listen=(ROUTER_ENDPOINT,))
CLIENT_OF_ROUTER = ZenohSettings(mode="client", connect=(ROUTER_ENDPOINT,), connect_timeout_s=10.0)
ROOT_OF_FLEET = SetElsewhere((("root", "fleet.root"),))
NAMES_OF_FLEET = SetElsewhere((("root", "fleet.root"), ("map_name", "fleet.map")))


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """One section a field; `trigpoint config show` prints them."""

    fleet: FleetSettings
    bus: ZenohSettings = field(default_factory=lambda: CLIENT_OF_ROUTER)
    log: LogSettings = field(default_factory=LogSettings)
    database: DatabaseSettings = field(default_factory=DatabaseSettings)
    ingest: Annotated[IngestSettings, NAMES_OF_FLEET] = field(default_factory=IngestSettings)
    filtering: FilterSettings = field(default_factory=FilterSettings)
    optimisation: SolveSettings = field(default_factory=SolveSettings)
    landmarks: LandmarkSettings = field(default_factory=LandmarkSettings)
    answers: AnswerSettings = field(default_factory=AnswerSettings)
    web: WebSettings = field(default_factory=WebSettings)
    vehicle: Annotated[VehicleSettings, ROOT_OF_FLEET] = field(default_factory=VehicleSettings)
    router: RouterSettings = field(default_factory=lambda: ROUTER)
    up: UpSettings = field(default_factory=UpSettings)
    serve: ServeSettings = field(default_factory=ServeSettings)
    http: HttpSettings = field(default_factory=HttpSettings)
    logging: LoggingSettings = field(default_factory=LoggingSettings)
    tracing: TracingSettings = field(default_factory=TracingSettings)


@dataclass(frozen=True, slots=True, kw_only=True)
class _LogOnly:
    """A configuration of which only the log counts."""

    log: LogSettings = field(default_factory=LogSettings)


def configured_settings(file: Path | None, flags: Sequence[str]) -> Configured[Settings]:
    """The settings from flags, over the environment, over a file. Raises ConfigurationRefused, InputError."""
    return configured(Settings, _layers(file, flags))


def log_settings(file: Path | None, flags: Sequence[str]) -> LogSettings:
    """The log's section alone, for commands that need nothing else set; raises as `configured_settings` does."""
    layers = [{path: given for path, given in layer.items() if path[0] == "log"} for layer in _layers(file, flags)]
    return configured(_LogOnly, layers).settings.log


def _layers(file: Path | None, flags: Sequence[str]) -> list[Layer]:
    layers = [from_environment(os.environ), from_flags(flags)]
    return layers if file is None else [from_toml(file), *layers]


def password_of(database: DatabaseSettings) -> str | None:
    """The database's password: the content of its file, without the end of the line. Raises InputError."""
    if database.password_file is None:
        return None
    try:
        return database.password_file.read_text(encoding="utf-8").rstrip("\n")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"[database] password_file {database.password_file}: cannot be read: {error}") from error


def secrets_of(settings: Settings) -> Secrets:
    """What must not be logged. Raises InputError where a file of it cannot be read."""
    secrets = Secrets()
    in_url = urlsplit(settings.database.url).password
    for text in (password_of(settings.database), in_url, in_url and unquote(in_url)):
        if text:
            secrets.add(text)
    return secrets


def configuration_options(function: Callable[..., Any]) -> Callable[..., Any]:
    """A command that gets `config` (a path or None) and `flags`."""
    chosen = click.option(
        "--set",
        "flags",
        multiple=True,
        metavar="SECTION.KEY=VALUE",
        help="A value over that of the environment and the file; may be given more than once.",
    )(function)
    option: Callable[..., Any] = click.option(
        "--config", metavar="FILE", type=click.Path(path_type=Path), help="The configuration, in TOML."
    )
    result: Callable[..., Any] = option(chosen)
    return result
