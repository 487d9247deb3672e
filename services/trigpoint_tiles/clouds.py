"""A drive's sweeps in the log, and its path in the newest map version."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import cast

import numpy as np
from numpy.typing import NDArray

from trigpoint.events.codec import schema_name
from trigpoint.events.mapped import TrajectorySolved
from trigpoint.events.scanned import PointsScanned
from trigpoint.logs.ports import RecallingLog
from trigpoint.logs.readings import VEHICLE_PREFIX, vehicle_streams
from trigpoint_tiles.core.driven_path import DrivenPath, path_of

Ints = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class DriveName:
    """A vehicle and one of its boots."""

    vehicle: str
    boot_id: str

    def __str__(self) -> str:
        return f"{self.vehicle}/{self.boot_id}"


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveClouds:
    """Which sweeps a drive has: sequence (n,) and stamp_ns (n,), in order of the log; its path, None without one."""

    name: DriveName
    sequence: Ints
    stamp_ns: Ints
    path: DrivenPath | None

    def selected(self, rows: Ints) -> "DriveClouds":
        """Those sweeps alone."""
        return DriveClouds(name=self.name, sequence=self.sequence[rows], stamp_ns=self.stamp_ns[rows], path=self.path)


def logged_clouds(log: RecallingLog, trajectories: tuple[TrajectorySolved, ...]) -> tuple[DriveClouds, ...]:
    """Every drive with sweeps, by name; no sweep is read for it."""
    paths = {DriveName(one.vehicle, one.boot_id): path_of(one) for one in trajectories}
    rows: dict[DriveName, list[tuple[Ints, Ints]]] = {}
    for stream in vehicle_streams(log):
        for run in log.read_headers(stream):
            scans = np.array([schema == schema_name(PointsScanned) for schema in run.schemas])[run.schema_of_row]
            if scans.any():
                name = DriveName(run.source, run.boot_id)
                rows.setdefault(name, []).append((run.sequences[scans], run.stamps_ns[scans]))
    return tuple(
        DriveClouds(
            name=name,
            sequence=np.concatenate([sequence for sequence, _ in parts]),
            stamp_ns=np.concatenate([stamp_ns for _, stamp_ns in parts]),
            path=paths.get(name),
        )
        for name, parts in sorted(rows.items(), key=lambda row: (row[0].vehicle, row[0].boot_id))
    )


def read_sweeps(log: RecallingLog, clouds: DriveClouds) -> Iterator[tuple[int, int, PointsScanned]]:
    """Row, stamp in ns and sweep of each of a drive's sweeps, one in memory at a time."""
    if not len(clouds.sequence):
        return
    row_of = {sequence: row for row, sequence in enumerate(clouds.sequence.tolist())}
    first_ns, last_ns = int(clouds.stamp_ns.min()), int(clouds.stamp_ns.max())
    stream = f"{VEHICLE_PREFIX}{clouds.name.vehicle}"
    for logged in log.read(stream, from_ns=first_ns, until_ns=last_ns + 1, kinds=(PointsScanned,)):
        identity = logged.envelope.identity
        row = row_of.get(identity.sequence) if identity.boot_id == clouds.name.boot_id else None
        if row is not None:
            yield row, logged.envelope.stamp_ns, cast(PointsScanned, logged.envelope.event)
