"""What a new map version renders anew, beside a full render of it."""

from collections.abc import Callable
from functools import cache, partial
from pathlib import Path

from figures.figure import Bounds, Figure, Measurement, at_least
from figures.workbench import Workbench
from scanned_drives.moved_street import (
    MOVED_M,
    OTHER_STREET,
    STREET,
    RenderedAnew,
    bent_street,
    rendered_anew,
    smooth_ground,
    whole_street,
)

WHOLE, BENT = "whole", "bent"


@cache
def anew(folder: Path, street: str) -> RenderedAnew:
    """One comparison, once a run."""
    if street == WHOLE:
        return rendered_anew(folder / "anew-whole", OTHER_STREET, whole_street())
    return rendered_anew(folder / "anew-bent", STREET, bent_street(), world=smooth_ground)


def of_street(bench: Workbench, *, street: str, value: Callable[[RenderedAnew], float]) -> Measurement:
    """A number of one comparison."""
    command = f"scanned_drives.moved_street.rendered_anew(…)  # a street's {street} path"
    return Measurement(value=float(value(anew(bench.folder, street))), command=command)


def _figure(
    name: str, street: str, value: Callable[[RenderedAnew], float], *, unit: str = "1", target: Bounds | None = None
) -> Figure:
    return Figure(name=name, unit=unit, target=target, measure=partial(of_street, street=street, value=value))


def _figures(name: str, street: str) -> tuple[Figure, ...]:
    return (
        _figure(f"{name}: tiles in all", street, lambda found: found.tiles),
        _figure(f"{name}: tiles rendered", street, lambda found: found.touched),
        _figure(
            f"{name}: tiles equal to a full render, share",
            street,
            lambda found: found.equal / found.tiles,
            unit="",
            target=at_least(1.0),
        ),
    )


FIGURES = (
    *_figures(f"a street moved by {MOVED_M:g} m", WHOLE),
    *_figures(f"the middle of a street moved by {MOVED_M:g} m, its ends not", BENT),
)
