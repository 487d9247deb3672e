"""The HTTP service as a process of its own."""

from collections.abc import Iterator
from contextlib import closing, contextmanager, nullcontext

from trigpoint.bus.zenoh_bus import ZenohBus
from trigpoint.observability.metrics import Instruments
from trigpoint.observability.running import Service
from trigpoint_cli.feature_source import opened_source
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
            lambda: opened_source(
                database_url(settings),
                password_file=settings.database.password_file,
                connections=settings.web.connections,
            ),
            log=ServedLog(corrections=LoggedCorrections(data), drives=LoggedMeasurements(data), shifts=data.shifts),
            bus=bus,
            root=settings.fleet.root,
            instruments=instruments,
        )
        with closing(service):
            yield service
