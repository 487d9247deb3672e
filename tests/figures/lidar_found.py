"""What perception finds along a street of the campus, from points alone."""

from collections.abc import Callable
from functools import partial

from figures.figure import Bounds, Figure, Measurement, at_least
from figures.workbench import Workbench
from perceived_campus.finding import Found, found_along
from perceived_campus.offsets import PoleOffsets, pole_offsets_along

LENGTH_M, SEED = 600.0, 1
COMMAND = f"perceived_campus.finding.found_along(length_m={LENGTH_M:g}, seed={SEED})"
OFFSETS = f"perceived_campus.offsets.pole_offsets_along(length_m={LENGTH_M:g}, seed={SEED})"


def of_kind(bench: Workbench, *, kind: str, value: Callable[[Found], float]) -> Measurement:
    """A number of one kind of landmark."""
    return Measurement(value=float(value(found_along(length_m=LENGTH_M, seed=SEED)[kind])), command=COMMAND)


def of_offsets(bench: Workbench, *, value: Callable[[PoleOffsets], float]) -> Measurement:
    """A number of the sights of poles."""
    return Measurement(value=value(pole_offsets_along(length_m=LENGTH_M, seed=SEED)), command=OFFSETS)


def _offset(name: str, unit: str, value: Callable[[PoleOffsets], float]) -> Figure:
    name = f"campus, points alone: sights of poles, {name}"
    return Figure(name=name, unit=unit, target=None, measure=partial(of_offsets, value=value))


def _figure(name: str, kind: str, value: Callable[[Found], float], target: Bounds | None = None) -> Figure:
    unit = "1" if target is None else ""
    return Figure(
        name=f"campus, points alone: {name}", unit=unit, target=target, measure=partial(of_kind, kind=kind, value=value)
    )


FIGURES = (
    _figure("poles, precision within 0.3 m", "pole", lambda found: found.precision, at_least(0.95)),
    _figure("poles, recall of those with 20 points in 3 sweeps", "pole", lambda found: found.recall, at_least(0.90)),
    _figure("poles that should be found", "pole", lambda found: found.seen),
    _figure("corners, precision within 0.3 m", "corner", lambda found: found.precision, at_least(0.85)),
    _figure(
        "corners, recall of those with points on both walls",
        "corner",
        lambda found: found.recall,
        at_least(0.75),
    ),
    _figure("corners that should be found", "corner", lambda found: found.seen),
    _offset("too far by, mean", "m", lambda offsets: float(offsets.too_far_m.mean())),
    _offset("radius too large by, mean", "m", lambda offsets: float(offsets.too_thick_m.mean())),
    _offset("NEES along the ray", "1", lambda offsets: offsets.nees_along),
    _offset("NEES across the ray", "1", lambda offsets: offsets.nees_aside),
)
