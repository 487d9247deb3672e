"""PostgreSQL restarted, and the projection killed, in mid-projection: what differs from a replay of the log then."""

from collections.abc import Callable
from functools import cache, partial
from pathlib import Path

from figures.figure import Figure, Measurement, at_least, at_most
from figures.workbench import CommandFailed, Workbench
from landmark_databases.cluster import Cluster, binaries, running_cluster
from landmark_databases.faults import Fault, Trial, differences_after, killed
from landmark_maps.histories import History

HISTORY = History(landmark_count=2_000, changed_count=400, event_count=200_000)
RESTARTED = Trial(history=HISTORY, batch_events=2_000, times=10, seed=1)
KILLED = Trial(history=HISTORY, batch_events=2_000, times=20, seed=2)

FaultOf = Callable[[Cluster], Fault]


def restart_of(cluster: Cluster) -> Fault:
    """The server stopped as if its power had failed, and started anew."""
    return lambda _: cluster.restart("immediate")


def kill_of(cluster: Cluster) -> Fault:
    """The projection killed, and started anew."""
    return killed


@cache
def outcome_of(folder: Path, fault_of: FaultOf, trial: Trial) -> tuple[int, int]:
    """How often the fault struck in mid-projection, and how many rows differ in the end."""
    if binaries() is None:
        raise CommandFailed("no PostgreSQL with PostGIS is installed")
    with running_cluster(durable=True) as cluster:
        data = folder / f"projection-{fault_of.__name__}"
        struck, found = differences_after(fault_of(cluster), trial, data=data, cluster=cluster)
    return struck, len(found)


def _measured(bench: Workbench, *, fault_of: FaultOf, trial: Trial, index: int) -> Measurement:
    shown = f"trigpoint serve landmarks  # {trial.times} times {fault_of.__name__}, then compared with a replay"
    try:
        return Measurement(value=outcome_of(bench.folder, fault_of, trial)[index], command=shown)
    except (OSError, TimeoutError) as error:
        raise CommandFailed(f"{shown}: {error}") from error


def _figures(what: str, fault_of: FaultOf, trial: Trial) -> tuple[Figure, ...]:
    measured = partial(_measured, fault_of=fault_of, trial=trial)
    return (
        Figure(
            name=f"{what} in mid-projection", unit="", target=at_least(trial.times), measure=partial(measured, index=0)
        ),
        Figure(
            name=f"{what}: rows that differ from a replay of the log",
            unit="",
            target=at_most(0.0),
            measure=partial(measured, index=1),
        ),
    )


FIGURES = (
    *_figures("PostgreSQL restarted", restart_of, RESTARTED),
    *_figures("projection killed", kill_of, KILLED),
)
