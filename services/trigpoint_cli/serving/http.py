"""The HTTP service as a process of its own."""

from collections.abc import Iterator
from contextlib import closing, contextmanager, nullcontext
from pathlib import Path

from trigpoint.bus.zenoh_bus import ZenohBus
from trigpoint.landmarks.feature_query import FeatureSource
from trigpoint.landmarks.opening import geopackage_path
from trigpoint.observability.metrics import Instruments
from trigpoint.observability.running import Service
from trigpoint_cli.serving.map_corrections import LoggedCorrections
from trigpoint_cli.serving.measured_drives import LoggedMeasurements
from trigpoint_cli.serving.resources import data_of, database_url
from trigpoint_cli.settings import Settings
from trigpoint_landmarks.http.serving import HttpService, ServedLog


@contextmanager
def opened(settings: Settings, instruments: Instruments) -> Iterator[Service]:
    """The service on the fleet's database, which it reads, its log and its bus. Raises InputError, ServiceError."""
    data = data_of(settings)
    heard = ZenohBus(settings.bus) if settings.web.listen_to_bus else nullcontext()
    with heard as bus:
        service = HttpService(
            settings.web,
            lambda: opened_source(settings),
            log=ServedLog(corrections=LoggedCorrections(data), drives=LoggedMeasurements(data)),
            bus=bus,
            root=settings.fleet.root,
            instruments=instruments,
        )
        with closing(service):
            yield service


def opened_source(settings: Settings) -> FeatureSource:
    """The database of the configuration, to be asked for features. Raises InputError."""
    url = database_url(settings)
    path = geopackage_path(url)
    if path is not None:
        from trigpoint.landmarks.geopackage_features import GeoPackageFeatures

        return GeoPackageFeatures(Path(path))
    from trigpoint.landmarks.postgis_features import PostgisFeatures  # costs half a second a file does not need

    return PostgisFeatures(url, password_file=settings.database.password_file, connections=settings.web.connections)
