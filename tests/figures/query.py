"""The map asked over Zenoh: beside a bare queryable that returns the same bytes, and how soon a change is there."""

from collections.abc import Callable
from functools import cache, partial

import numpy as np

from figures.figure import Bounds, Figure, Measurement, at_most
from figures.workbench import Workbench
from map_answers.racing import MILLISECONDS, Floats, QueryRace, query_race, reach_times_ms

LANDMARKS, QUERIES, SEED = 200_000, 3_000, 1
VERSIONS, PAUSE_S = 400, 0.05
RACE = f"map_answers.racing.query_race(landmarks={LANDMARKS}, queries={QUERIES}, seed={SEED})"
REACH = f"map_answers.racing.reach_times_ms(versions={VERSIONS}, pause_s={PAUSE_S:g})"


@cache
def race() -> QueryRace:
    """All queries of one run."""
    return query_race(landmarks=LANDMARKS, queries=QUERIES, seed=SEED)


@cache
def reach_ms() -> Floats:
    """How long each version was under way."""
    return reach_times_ms(versions=VERSIONS, pause_s=PAUSE_S)


def of_race(bench: Workbench, *, value: Callable[[QueryRace], float]) -> Measurement:
    """A number of the queries."""
    return Measurement(value=value(race()), command=RACE)


def of_reach(bench: Workbench, *, percentile: float) -> Measurement:
    """A percentile of the times under way."""
    return Measurement(value=float(np.percentile(reach_ms(), percentile)), command=REACH)


def queried(name: str, unit: str, target: Bounds | None, value: Callable[[QueryRace], float]) -> Figure:
    """A figure of the queries."""
    return Figure(name=name, unit=unit, target=target, measure=partial(of_race, value=value))


def reached(name: str, target: Bounds | None, percentile: float) -> Figure:
    """A figure of the times under way."""
    return Figure(name=name, unit="ms", target=target, measure=partial(of_reach, percentile=percentile))


FIGURES = (
    queried("25 of 200,000 landmarks, p50 over a bare queryable's", "x", at_most(2.0), lambda found: found.ratio(50)),
    queried("the same, p99", "x", at_most(3.0), lambda found: found.ratio(99)),
    queried("the same, p50", "ms", None, lambda found: float(np.median(found.answered_s)) * MILLISECONDS),
    queried("the bare queryable's p50", "ms", None, lambda found: float(np.median(found.bare_s)) * MILLISECONDS),
    queried(
        "with the landmarks decoded, p50 over a bare queryable's", "x", None, lambda found: found.decoded_ratio(50)
    ),
    queried("landmarks in an answer, mean", "", None, lambda found: float(found.found.mean())),
    reached("a moved landmark at a subscribed client after its version is durable, p99", at_most(200.0), 99),
    reached("the same moved landmark, p50", None, 50),
)
