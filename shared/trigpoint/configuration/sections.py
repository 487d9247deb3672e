"""The sections of the configuration that belong to no service."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal, get_args
from urllib.parse import urlsplit

from pydantic import Field

from trigpoint.configuration.limits import Count, Name, Port, Positive, Seconds, Share
from trigpoint.errors import InputError
from trigpoint.events.keys import DEFAULT_MAP, DEFAULT_ROOT, valid_name

DATABASE_SCHEMES = ("geopackage", "postgresql+psycopg")


@dataclass(frozen=True, slots=True, kw_only=True)
class FleetSettings:
    """The first chunk of every key, the map's name, and the data directory, whose `log` all services read.

    Raises InputError for a name that cannot be a chunk of a key.
    """

    data: Path
    root: Name = DEFAULT_ROOT
    map: Name = DEFAULT_MAP

    def __post_init__(self) -> None:
        valid_name(self.root)
        valid_name(self.map)


FILE_BYTES_LEAST = 65_536  # every file has a beginning and an end of its own
MIB = 1024 * 1024


@dataclass(frozen=True, slots=True, kw_only=True)
class LogSettings:
    """When a file of the log ends, and what `trigpoint log retain` keeps unless it is told otherwise.

    A file ends at `file_bytes`, or at `file_span_s` of measurements if it is not small then, or after it was open for
    `file_age_s`. Kept is what was measured in the last `keep_days`, or the newest `keep_bytes`; without either nothing
    is said about it.
    """

    file_bytes: Annotated[int, Field(ge=FILE_BYTES_LEAST)] = 64 * MIB
    file_span_s: Positive = 3_600.0
    file_age_s: Positive = 86_400.0
    keep_days: Positive | None = None
    keep_bytes: Count | None = None

    def __post_init__(self) -> None:
        if self.keep_days is not None and self.keep_bytes is not None:
            raise InputError(f"keep_days {self.keep_days:g} and keep_bytes {self.keep_bytes}: only one may be set")


@dataclass(frozen=True, slots=True, kw_only=True)
class DatabaseSettings:
    """The landmark database: `geopackage:` (in the data directory), `geopackage:PATH` or
    `postgresql+psycopg://USER@HOST/NAME`, whose password is the content of `password_file`.
    """

    url: str = "geopackage:"
    password_file: Path | None = None

    def __post_init__(self) -> None:
        scheme = self.url.partition(":")[0]
        if scheme not in DATABASE_SCHEMES:
            raise InputError(f"url {scheme!r}: begins with {' or '.join(f'{name}:' for name in DATABASE_SCHEMES)}")
        if self.password_file is not None and urlsplit(self.url).password:
            raise InputError("url: holds a password, and so does password_file; only one may")


@dataclass(frozen=True, slots=True, kw_only=True)
class HttpSettings:
    """Where each process answers /healthz, /readyz and /metrics; port 0 takes any free one and logs it."""

    enabled: bool = True
    host: Name = "127.0.0.1"
    up_port: Port = 9460
    router_port: Port = 9461
    ingest_port: Port = 9462
    filtering_port: Port = 9463
    optimisation_port: Port = 9464
    landmarks_port: Port = 9465
    answers_port: Port = 9466
    http_port: Port = 9467
    perception_port: Port = 9468
    parallel_limit: Annotated[int, Field(ge=1, le=256)] = 8
    request_timeout_s: Seconds = 5.0

    def __post_init__(self) -> None:
        ports = self.ports()
        for name, port in ports.items():
            double = [other for other in ports if other != name and port != 0 and ports[other] == port]
            if double:
                raise InputError(f"{name}_port = {port}: {double[0]}_port has the same; each process needs its own")

    def ports(self) -> dict[str, int]:
        """The port of each process."""
        return {
            "up": self.up_port,
            "router": self.router_port,
            "ingest": self.ingest_port,
            "filtering": self.filtering_port,
            "optimisation": self.optimisation_port,
            "landmarks": self.landmarks_port,
            "answers": self.answers_port,
            "http": self.http_port,
            "perception": self.perception_port,
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class LoggingSettings:
    """What is logged on standard error, as JSON lines or plain ones."""

    level: Literal["DEBUG", "INFO", "WARNING", "ERROR"] = "INFO"
    form: Literal["json", "plain"] = "json"


@dataclass(frozen=True, slots=True, kw_only=True)
class TracingSettings:
    """Where spans are sent by OTLP over HTTP, such as "http://127.0.0.1:4318/v1/traces"; None: nowhere."""

    endpoint: str | None = None
    sampled_share: Share = 1.0
    timeout_s: Seconds = 5.0

    def __post_init__(self) -> None:
        if self.endpoint is not None and urlsplit(self.endpoint).scheme not in ("http", "https"):
            raise InputError(f"endpoint {self.endpoint!r}: begins with http:// or https://")


ServiceName = Literal["router", "ingest", "filtering", "perception", "optimisation", "landmarks", "answers", "http"]


@dataclass(frozen=True, slots=True, kw_only=True)
class UpSettings:
    """How one machine's processes are supervised: which, in which order they start and in reverse stop.

    One that ends is started again after `backoff_first_s`, doubled each time up to `backoff_ceiling_s`, until it
    has lived for `steady_s`. After `failing_count` ends in a row it is called failing. Ending takes at most
    `stop_limit_s` a process.
    """

    services: tuple[ServiceName, ...] = get_args(ServiceName)
    backoff_first_s: Seconds = 0.5
    backoff_ceiling_s: Seconds = 30.0
    steady_s: Seconds = 60.0
    failing_count: Count = 5
    start_limit_s: Seconds = 20.0
    stop_limit_s: Seconds = 15.0

    def __post_init__(self) -> None:
        double = sorted({name for name in self.services if self.services.count(name) > 1})
        if double or not self.services:
            raise InputError(f"services {list(self.services)}: at least one, and none twice")
        if self.backoff_first_s > self.backoff_ceiling_s:
            raise InputError(f"backoff_first_s = {self.backoff_first_s:g}: at most {self.backoff_ceiling_s:g}")


@dataclass(frozen=True, slots=True, kw_only=True)
class ServeSettings:
    """A service told to stop has `stop_limit_s` to finish what it began; then its process ends all the same. One whose
    loop has not come round for `silence_limit_s` is not healthy: longer than any single piece of its work takes.
    """

    stop_limit_s: Seconds = 10.0
    silence_limit_s: Seconds = 120.0
