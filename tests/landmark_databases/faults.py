"""What a projection goes through: its database restarted, itself killed, and what is in the database in the end."""

import random
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from landmark_databases.cluster import Cluster
from landmark_databases.served import ServedProjection, projecting, taken_in, wait_until
from landmark_maps.histories import History, append_history
from trigpoint.events.keys import STREAM_PATTERNS
from trigpoint.events.mapped import MapSolved
from trigpoint.landmarks.postgis_store import PostgisStore
from trigpoint.logs.mcap_log import McapLog
from trigpoint_landmarks.app import replay_difference
from trigpoint_landmarks.core.comparison import RowDifference

MAP_STREAM = STREAM_PATTERNS[MapSolved]
LIMIT_S = 120.0

Fault = Callable[[ServedProjection], None]


@dataclass(frozen=True, slots=True, kw_only=True)
class Trial:
    """A history to project, in how large steps, and how often a fault strikes on the way, at random moments."""

    history: History
    batch_events: int
    times: int
    seed: int


def differences_after(
    fault: Fault, trial: Trial, *, data: Path, cluster: Cluster
) -> tuple[int, tuple[RowDifference, ...]]:
    """How often the fault struck in mid-projection, and where the database then differs from a replay of the log."""
    log = McapLog(data / "log")
    append_history(log, trial.history)
    total, database = log.next_number(MAP_STREAM), cluster.created()
    log.close()
    chance, struck = random.Random(trial.seed), 0
    with projecting(data, cluster, database, batch_events=trial.batch_events) as served:
        for turn in range(1, trial.times + 1):
            wanted = round(
                total * (turn - chance.random()) / (trial.times + 1)
            )  # later than the last one's, and before the end
            wait_until(lambda wanted=wanted: taken_in(cluster, database) >= wanted, limit_s=LIMIT_S)  # type: ignore[misc]
            struck += taken_in(cluster, database) < total
            fault(served)
        wait_until(lambda: taken_in(cluster, database) == total and served.is_ready(), limit_s=LIMIT_S)
    reopened = McapLog(data / "log")
    store = PostgisStore(cluster.url(database), password_file=cluster.password_file, read_only=True)
    try:
        return struck, replay_difference(reopened, store)
    finally:
        store.close()
        reopened.close()


def killed(served: ServedProjection) -> None:
    """The projection killed, and started again."""
    served.kill()
    served.start()
