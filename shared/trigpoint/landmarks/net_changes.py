"""Several consecutive map versions as one change: what comes and goes within them is never among the valid rows."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from trigpoint.errors import InputError
from trigpoint.landmarks.model import Landmark, MapChange


@dataclass(frozen=True, slots=True, kw_only=True)
class NetChange:
    """What consecutive versions come to, for the landmarks.

    `closed`: ids valid before the first version, and the version that ends each. `ended`: rows opened and ended by
    these versions. `opened`: rows still valid after the last one.
    """

    closed: Mapping[str, int]
    ended: tuple[Landmark, ...]
    opened: tuple[Landmark, ...]


def net_change(changes: Sequence[MapChange]) -> NetChange:
    """The versions as one change. Raises InputError for an id closed twice or opened while still valid."""
    closed: dict[str, int] = {}
    ended: list[Landmark] = []
    opened: dict[str, Landmark] = {}
    for change in changes:
        map_version = change.version.map_version
        for name in change.closed:
            row = opened.pop(name, None)
            if row is not None:
                ended.append(row.until(map_version))
            elif name not in closed:
                closed[name] = map_version
            else:
                raise InputError(f"map version {map_version} closes {name!r}: it is not valid")
        for row in change.opened:
            if row.landmark in opened:
                raise InputError(f"map version {map_version} opens {row.landmark!r}: it is still valid")
            opened[row.landmark] = row
    return NetChange(closed=closed, ended=tuple(ended), opened=tuple(opened.values()))
