"""What the services of a fleet share: the log and the bus, opened as the configuration says."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from trigpoint.bus.zenoh_bus import ZenohBus
from trigpoint.configuration.sections import LogSettings
from trigpoint.landmarks.opening import geopackage_path, geopackage_url
from trigpoint.logs.mcap_log import McapLog
from trigpoint.logs.stream_writer import Rotation
from trigpoint_cli.data_dir import DataDirectory
from trigpoint_cli.settings import Settings

NS_PER_S = 1e9


@dataclass(frozen=True, slots=True)
class Resources:
    """The fleet's log and this process's session on the bus."""

    log: McapLog
    bus: ZenohBus


def data_of(settings: Settings) -> DataDirectory:
    """The data directory of the fleet."""
    return DataDirectory(settings.fleet.data)


def database_url(settings: Settings) -> str:
    """The URL of the landmark database; one that names no file is that of the data directory."""
    url = settings.database.url
    return geopackage_url(data_of(settings).database) if geopackage_path(url) == Path() else url


def rotation_of(settings: LogSettings) -> Rotation:
    """When a file of the log is long enough, as it is configured."""
    span_ns, age_ns = round(settings.file_span_s * NS_PER_S), round(settings.file_age_s * NS_PER_S)
    return Rotation(size_bytes=settings.file_bytes, span_ns=span_ns, age_ns=age_ns)


@contextmanager
def opened_resources(settings: Settings) -> Iterator[Resources]:
    """The log and the bus; closed in reverse, the log last. Raises InputError, ServiceError."""
    with data_of(settings).new_log(rotation_of(settings.log)) as log, ZenohBus(settings.bus) as bus:
        yield Resources(log, bus)
