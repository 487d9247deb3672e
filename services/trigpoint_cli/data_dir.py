"""A data directory: where its log, its projections and what was made beside them stand."""

from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click

from trigpoint.errors import InputError
from trigpoint.landmarks.opening import geopackage_path, opened_store
from trigpoint.landmarks.ports import LandmarkStore
from trigpoint.logs.mcap_log import DEFAULT_ROTATION, McapLog
from trigpoint.logs.stream_writer import Rotation
from trigpoint_cli.database import DATABASE_NAME, EMBEDDED, AskedDatabase, asked_database, database_settings

LOG_NAME = "log"


@dataclass(frozen=True, slots=True)
class DataDirectory:
    """The paths of a data directory; truth stands apart from what the services see.

    `asked` says which landmark database is opened; what it leaves open is as the directory's own configuration says.
    """

    path: Path
    asked: AskedDatabase = EMBEDDED

    @property
    def log(self) -> Path:
        """The event log, the only truth there is; everything else can be made again from it."""
        return self.path / LOG_NAME

    @property
    def database(self) -> Path:
        """The landmark database, unless another one is configured."""
        return self.path / DATABASE_NAME

    @property
    def report(self) -> Path:
        """The report of the newest map version."""
        return self.path / "report.html"

    @property
    def anchors(self) -> Path:
        """A simulation's anchors, as a file to import."""
        return self.path / "anchors.geojson"

    @property
    def truth(self) -> Path:
        """A simulation's truth."""
        return self.path / "truth" / "truth.csv"

    @property
    def objects(self) -> Path:
        """What stands in a simulated world that a lidar looks at."""
        return self.path / "truth" / "objects.csv"

    @property
    def aerial(self) -> Path:
        """A simulation's aerial pictures, a folder of tiles each."""
        return self.path / "aerial"

    @property
    def shifts(self) -> Path:
        """Where aerial images lie beside the ortho layer, a check layer each."""
        return self.path / "shifts"

    @property
    def solves(self) -> Path:
        """What builds kept so that measuring them needs no second solve."""
        return self.path / "solves"

    @property
    def vehicles(self) -> Path:
        """The vehicles' own logs."""
        return self.path / "vehicles"

    def kept_shifts(self, image: str) -> Path:
        """The file of an image's check layer, its folder made. Raises InputError where it cannot be."""
        if not self.path.is_dir():
            raise InputError(f"{self.path}: no such data directory; `trigpoint ingest` makes one")
        try:
            self.shifts.mkdir(exist_ok=True)
        except OSError as error:
            raise InputError(f"{self.shifts}: cannot be made: {error}") from error
        return self.shifts / f"{image}.geojson"

    @contextmanager
    def opened_log(self) -> Iterator[McapLog]:
        """The log, which has to be there with something in it. Raises InputError."""
        if not self.path.is_dir():
            raise InputError(f"{self.path}: no such data directory; `trigpoint ingest` makes one")
        if not self.log.is_dir():
            raise InputError(f"{self.path}: no log in there; `trigpoint ingest LOG --data {self.path}` makes one")
        with self.new_log() as log:
            if not log.streams():
                raise InputError(f"{self.log}: the log is empty; `trigpoint ingest LOG --data {self.path}` fills it")
            yield log

    @contextmanager
    def new_log(self, rotation: Rotation = DEFAULT_ROTATION) -> Iterator[McapLog]:
        """The log, made where it is not there yet. Raises InputError if it cannot be."""
        try:
            log = McapLog(self.log, rotation=rotation)
        except OSError as error:
            raise InputError(f"{self.log}: no log can be opened here: {error}") from error
        try:
            yield log
        finally:
            log.close()

    @contextmanager
    def opened_database(self, *, read_only: bool) -> Iterator[LandmarkStore]:
        """The landmark database. Raises InputError where it is not there and only to be read."""
        if read_only and not self.path.is_dir():
            raise InputError(f"{self.path}: no such data directory; `trigpoint ingest` makes one")
        chosen = database_settings(self.path, self.asked)
        file = geopackage_path(chosen.url)
        if read_only and file is not None and not file.is_file():
            raise InputError(f"{file}: no landmark database; `trigpoint build --data {self.path}` makes one")
        with closing(opened_store(chosen.url, password_file=chosen.password_file, read_only=read_only)) as store:
            yield store


def _directory(context: click.Context, parameter: click.Parameter, value: Path) -> DataDirectory:
    return DataDirectory(value, asked_database(context))


def _directory_if_any(context: click.Context, parameter: click.Parameter, value: Path | None) -> DataDirectory | None:
    return None if value is None else _directory(context, parameter, value)


def _directories(
    context: click.Context, parameter: click.Parameter, value: tuple[Path, ...]
) -> tuple[DataDirectory, ...]:
    return tuple(_directory(context, parameter, path) for path in value)


_AS_DIRECTORY: dict[str, Any] = {
    "required": True,
    "envvar": "TRIGPOINT_FLEET__DATA",
    "metavar": "DIR",
    "type": click.Path(path_type=Path),
}

data_option: Callable[[Any], Any] = click.option(
    "--data", callback=_directory, help="The data directory.", **_AS_DIRECTORY
)

beside_data_option: Callable[[Any], Any] = click.option(
    "--data", callback=_directory_if_any, help="The data directory, if any.", **{**_AS_DIRECTORY, "required": False}
)

several_data_option: Callable[[Any], Any] = click.option(
    "--data",
    multiple=True,
    callback=_directories,
    help="A data directory; more than one may be named.",
    **_AS_DIRECTORY,
)

cluster_option: Callable[[Any], Any] = click.option(
    "--cluster", default="", metavar="ADDRESS", help="A Dask scheduler, tcp://…, whose workers see the same files."
)

as_of_option: Callable[[Any], Any] = click.option(
    "--as-of", type=int, metavar="VERSION", help="The map version, the newest by default."
)
