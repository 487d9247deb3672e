"""Estimation that keeps up: update times in a large map, landmarks seen to be there, a vehicle without a receiver."""

from collections.abc import Callable
from functools import cache, partial
from pathlib import Path

from figures.figure import Bounds, Figure, Measurement, at_most
from figures.workbench import Workbench
from live_runs.campus_drives import Placed, UpdateTimes, update_times, without_receiver
from live_runs.late_perception import PerceivedUpdateTimes, perceived_update_times
from live_runs.perceiving import PerceivedLive, perceived_live
from live_runs.visibility import Visible, visible_within

VEHICLES, POSES, SEED = 5, 10_000, 1
SECONDS = 60.0
PERCEIVED_SECONDS = 130.0  # the receiver needs a hundred of them to tell a heading
UPDATES = f"live_runs.campus_drives.update_times(vehicles={VEHICLES}, poses={POSES}, seed={SEED})"
LATE = f"live_runs.late_perception.perceived_update_times(vehicles={VEHICLES}, poses={POSES}, seed={SEED})"
VISIBLE = f"live_runs.visibility.visible_within(seconds={SECONDS:g}, seed={SEED})"
PERCEIVED = f"live_runs.perceiving.perceived_live(seconds={PERCEIVED_SECONDS:g}, seed={SEED})"
PLACED = f"live_runs.campus_drives.without_receiver(seed={SEED})"


@cache
def updates() -> UpdateTimes:
    """The campus driven by enough vehicles for the map to have so many poses."""
    return update_times(vehicles=VEHICLES, poses=POSES, seed=SEED)


@cache
def perceived_updates() -> PerceivedUpdateTimes:
    """The same, of what perception says, some of it late."""
    return perceived_update_times(vehicles=VEHICLES, poses=POSES, seed=SEED)


@cache
def visible(folder: Path) -> Visible:
    """A drive in its own time."""
    return visible_within(folder / "visible", seconds=SECONDS, seed=SEED)


@cache
def perceived(folder: Path) -> PerceivedLive:
    """A drive with a lidar in its own time."""
    return perceived_live(folder / "perceived", seconds=PERCEIVED_SECONDS, seed=SEED)


@cache
def placed() -> Placed:
    """The second vehicle of the campus, its receiver taken away."""
    return without_receiver(seed=SEED)


def of_updates(bench: Workbench, *, value: Callable[[UpdateTimes], float]) -> Measurement:
    """A number of the update times."""
    return Measurement(value=value(updates()), command=UPDATES)


def of_perceived_updates(bench: Workbench, *, value: Callable[[PerceivedUpdateTimes], float]) -> Measurement:
    """A number of the update times with perception."""
    return Measurement(value=value(perceived_updates()), command=LATE)


def of_visible(bench: Workbench, *, value: Callable[[Visible], float]) -> Measurement:
    """A number of how soon landmarks are in the database."""
    return Measurement(value=value(visible(bench.folder)), command=VISIBLE)


def of_perceived(bench: Workbench, *, value: Callable[[PerceivedLive], float]) -> Measurement:
    """A number of the drive with a lidar."""
    return Measurement(value=value(perceived(bench.folder)), command=PERCEIVED)


def of_placed(bench: Workbench, *, value: Callable[[Placed], float]) -> Measurement:
    """A number of the vehicle without a receiver."""
    return Measurement(value=value(placed()), command=PLACED)


def figure(name: str, unit: str, target: Bounds | None, measure: Callable[[Workbench], Measurement]) -> Figure:
    """A figure of this group."""
    return Figure(name=name, unit=unit, target=target, measure=measure)


FIGURES = (
    figure(
        "incremental update, 10,000 poses in the map, p99",
        "ms",
        at_most(100.0),
        partial(of_updates, value=lambda found: found.p99_ms),
    ),
    figure(
        "the same, the processor's time", "ms", None, partial(of_updates, value=lambda found: found.p99_processor_ms)
    ),
    figure(
        "the same of landmarks perceived, some late",
        "ms",
        at_most(100.0),
        partial(of_perceived_updates, value=lambda found: found.p99_ms),
    ),
    figure(
        "landmarks perceived, some late: the processor's time",
        "ms",
        None,
        partial(of_perceived_updates, value=lambda found: found.p99_processor_ms),
    ),
    figure(
        "landmarks perceived, some late: updates while perception catches up",
        "ms",
        None,
        partial(of_perceived_updates, value=lambda found: found.late_p99_ms),
    ),
    figure(
        "landmarks perceived, some late: sweeps that came after their leg was whole",
        "1",
        None,
        partial(of_perceived_updates, value=lambda found: found.late_share),
    ),
    figure(
        "landmarks perceived, some late: sweeps that wait for the next whole solve",
        "1",
        None,
        partial(of_perceived_updates, value=lambda found: found.passed_over_share),
    ),
    figure(
        "from a sweep in the log to its landmark in the database, p95",
        "s",
        at_most(2.0),
        partial(of_visible, value=lambda found: found.p95_s),
    ),
    figure("the same, largest", "s", None, partial(of_visible, value=lambda found: found.most_s)),
    figure(
        "lidar, no detections: from a sweep in the log to its landmarks there, p95",
        "s",
        None,
        partial(of_perceived, value=lambda found: found.said_p95_s),
    ),
    figure(
        "the same of landmarks perceived, largest",
        "s",
        None,
        partial(of_perceived, value=lambda found: found.said_most_s),
    ),
    figure(
        "lidar, no detections: perceiving a sweep, mean",
        "s",
        at_most(0.1),
        partial(of_perceived, value=lambda found: found.sweep_s),
    ),
    figure(
        "lidar, no detections: incremental update meanwhile, p99",
        "ms",
        at_most(100.0),
        partial(of_perceived, value=lambda found: found.update_p99_ms),
    ),
    figure(
        "lidar, no detections: sweeps that came after their leg was whole",
        "1",
        None,
        partial(of_perceived, value=lambda found: found.late_share),
    ),
    figure(
        "lidar, no detections: sweeps that wait for the next whole solve",
        "1",
        None,
        partial(of_perceived, value=lambda found: found.passed_over_share),
    ),
    figure(
        "lidar, no detections: landmarks in the growing map",
        "1",
        None,
        partial(of_perceived, value=lambda found: float(found.landmarks)),
    ),
    figure(
        "lidar, no detections: their median distance to a true one",
        "m",
        None,
        partial(of_perceived, value=lambda found: found.off_m),
    ),
    figure(
        "no receiver: mean error against truth",
        "m",
        None,
        partial(of_placed, value=lambda found: found.mean_m),
    ),
    figure("no receiver: largest error", "m", None, partial(of_placed, value=lambda found: found.worst_m)),
    figure("no receiver: until it has a place", "s", None, partial(of_placed, value=lambda found: found.after_s)),
    figure("no receiver: NEES per degree of freedom", "", None, partial(of_placed, value=lambda found: found.nees)),
)
