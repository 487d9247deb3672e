"""`trigpoint vehicle`: the vehicle's side of a fleet."""

import functools
import tempfile
import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import click

from trigpoint.bus.zenoh_bus import ZenohSettings
from trigpoint.errors import InputError, ServiceError
from trigpoint_cli.output import Answer, JsonObject, Screen, answering
from trigpoint_cli.settings import configuration_options, configured_settings
from trigpoint_cli.stopping import stop_requests
from trigpoint_vehicle.publisher import Sent, VehiclePublisher
from trigpoint_vehicle.recorded_drive import Driven, RecordedDrive, VehicleLogs, logs_by_vehicle
from trigpoint_vehicle.settings import VehicleSettings
from trigpoint_vehicle.spool import Behind

GIVE_UP = click.FloatRange(min=0.0, min_open=True)
LOOK_S = 0.2  # between two looks whether the drives are over


@dataclass(frozen=True, slots=True)
class _Replayed:
    """What came of one vehicle's logs."""

    vehicle: str
    driven: Driven
    sent: Sent
    behind: Behind
    wall_s: float


@dataclass(frozen=True, slots=True)
class _Link:
    bus: ZenohSettings
    vehicle: VehicleSettings


def link_options(function: Callable[..., Answer]) -> Callable[..., Answer]:
    """A command that gets `link`: which bus to send on, and how."""

    @click.option("--connect", multiple=True, metavar="ENDPOINT", help="As tcp/127.0.0.1:7447; over [bus] connect.")
    @configuration_options
    @functools.wraps(function)
    def linked(
        *arguments: Any, connect: tuple[str, ...], config: Path | None, flags: tuple[str, ...], **options: Any
    ) -> Answer:
        return function(*arguments, link=_link(connect, config, flags), **options)

    return linked


@click.group("vehicle", help="The vehicle's side: send what vehicles recorded.")
def command() -> None:
    """Group of what can be done as a vehicle."""


@command.command("replay")
@click.argument("logs", nargs=-1, required=True, metavar="LOG...", type=click.Path(path_type=Path))
@click.option("--speed", type=float, default=1.0, show_default=True, metavar="X", help="0: as fast as it goes.")
@click.option("--spool", type=click.Path(path_type=Path), metavar="DIR", help="Kept; else a temporary one.")
@click.option(
    "--give-up-after-s", type=GIVE_UP, default=60.0, show_default=True, metavar="S", help="Without an acknowledgement."
)
@answering
@link_options
def replay(
    logs: tuple[Path, ...], speed: float, spool: Path | None, give_up_after_s: float, *, link: _Link, screen: Screen
) -> Answer:
    """Send vehicles' logs (MCAP) as the vehicles would, in recorded time times X, until everything is acknowledged.

    Each vehicle has a session and a spool of its own. Pauses of more than a minute in a recording are shortened to one.
    """
    if not 0.0 <= speed < float("inf"):
        raise InputError(f"--speed {speed:g}: 0 or more is needed")
    drives = logs_by_vehicle(logs)
    with ExitStack() as stack:
        folder = spool if spool is not None else Path(stack.enter_context(tempfile.TemporaryDirectory()))
        progress = stack.enter_context(screen.counting("replaying", unit="messages"))
        stop = threading.Event()

        def one(drive: VehicleLogs) -> _Replayed:
            return _replayed(drive, link, folder / drive.vehicle, _Run(speed, give_up_after_s, stop, progress))

        replayed = _all_of(drives, one, stop)
    return _answer(replayed, spool)


def _link(connect: tuple[str, ...], config: Path | None, flags: tuple[str, ...]) -> _Link:
    if config is None and not flags:
        if not connect:
            raise InputError("where is the fleet? --connect ENDPOINT or --config FILE is needed")
        return _Link(ZenohSettings(connect=connect), VehicleSettings())
    settings = configured_settings(config, flags).settings
    bus = replace(settings.bus, connect=connect) if connect else settings.bus
    return _Link(bus, settings.vehicle)


@dataclass(frozen=True, slots=True)
class _Run:
    speed: float
    silence_limit_s: float
    stop: threading.Event
    progress: Callable[[int], None]


def _replayed(drive: VehicleLogs, link: _Link, spool: Path, run: _Run) -> _Replayed:
    began_s = time.perf_counter()
    with VehiclePublisher(drive.vehicle, spool, link.bus, link.vehicle) as publisher:
        recorded = RecordedDrive(publisher, speed=run.speed, stop=run.stop, progress=run.progress)
        driven = recorded.run(drive.paths, silence_limit_s=run.silence_limit_s)
        sent, behind = publisher.sent, publisher.behind
    return _Replayed(drive.vehicle, driven, sent, behind, time.perf_counter() - began_s)


def _all_of(
    drives: tuple[VehicleLogs, ...], one: Callable[[VehicleLogs], _Replayed], stop: threading.Event
) -> list[_Replayed]:
    """Every vehicle in a thread of its own; a signal ends them all in order, then raises ServiceError."""
    with stop_requests() as requests, ThreadPoolExecutor(max_workers=len(drives)) as pool:
        running = [pool.submit(one, drive) for drive in drives]
        why = None
        while why is None and not all(future.done() for future in running):
            why = requests.wait(LOOK_S)
        stop.set()
        replayed = [future.result() for future in running]
    if why is not None:
        waiting = sum(one.behind.messages for one in replayed)
        raise ServiceError(f"ended by {why} with {waiting} messages not acknowledged")
    return replayed


def _answer(replayed: list[_Replayed], spool: Path | None) -> Answer:
    late = [one for one in replayed if not one.driven.is_acknowledged]
    if late:
        where = "their temporary spool is gone, their log has them" if spool is None else f"they stay in {spool}"
        waiting = ", ".join(f"{one.behind.messages} of {one.vehicle}" for one in late)
        raise ServiceError(f"messages not acknowledged: {waiting}; {where}")
    complaints = [
        f"{one.vehicle}: {text}"
        for one in replayed
        for text in (one.driven.damage, one.driven.refusal and f"{one.driven.refused} not sent: {one.driven.refusal}")
        if text
    ]
    values = {"vehicles": {one.vehicle: _values(one) for one in replayed}}
    return Answer(values, tuple(_line(one) for one in replayed), tuple(complaints))


def _values(one: _Replayed) -> JsonObject:
    behind = {"messages": one.behind.messages, "bytes": one.behind.bytes, "oldest_s": one.behind.oldest_s}
    return {
        "messages": one.driven.messages,
        "refused": one.driven.refused,
        "sent": one.sent.sent,
        "resent": one.sent.resent,
        "acknowledged": one.sent.acknowledged,
        "dropped": one.sent.dropped,
        "sessions": one.sent.sessions,
        "behind": behind,
        "behind_max_messages": one.driven.behind_max_messages,
        "wall_s": round(one.wall_s, 3),
    }


def _line(one: _Replayed) -> str:
    return (
        f"{one.vehicle}: {one.driven.messages} messages acknowledged in {one.wall_s:.1f} s, "
        f"{one.sent.resent} sent again"
    )
