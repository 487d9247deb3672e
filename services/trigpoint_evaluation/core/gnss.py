"""Fixes kept from a solve, and how far from them it puts the antenna."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from trigpoint.errors import InputError
from trigpoint.events.drives import Drive, first_stamp_ns
from trigpoint.events.mapped import TrajectorySolved
from trigpoint.geodesy.projection import MapFrame, map_points_from_wgs84
from trigpoint_evaluation.core.paths import antenna_points_m, poses_at
from trigpoint_evaluation.core.summary import ErrorSummary, distances_m, summary_of

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]
DriveName = tuple[str, str]

NS_PER_S = 1e9


@dataclass(frozen=True, slots=True, kw_only=True)
class Withholding:
    """Of every `period_s` of a drive, `duration_s` of fixes are withheld, the first time after `offset_s`."""

    period_s: float
    duration_s: float
    offset_s: float

    def __post_init__(self) -> None:
        if not 0.0 < self.period_s < float("inf"):
            raise InputError(f"withhold period {self.period_s} s: it must be above 0")
        if not 0.0 < self.duration_s < self.period_s:
            raise InputError(f"withhold duration {self.duration_s} s is outside 0 to the period, {self.period_s} s")


@dataclass(frozen=True, slots=True, kw_only=True)
class WithheldFixes:
    """The fixes (n,) of one drive that a solve did not see: stamps and positions (n, 2) in the map frame."""

    vehicle: str
    boot_id: str
    stamp_ns: Ints
    point_m: Floats


def withheld_mask(stamp_ns: Ints, first_ns: int, withholding: Withholding) -> Flags:
    """Which instants (n,) of a drive that began at `first_ns` are withheld."""
    since_s = (stamp_ns - first_ns) / NS_PER_S - withholding.offset_s
    mask: Flags = (since_s % withholding.period_s) < withholding.duration_s
    return mask


def without_withheld(drive: Drive, withholding: Withholding) -> Drive:
    """The drive as if the withheld fixes had never been received."""
    kept = ~withheld_mask(drive.fixes.stamp_ns, first_stamp_ns(drive), withholding)
    fixes = replace(
        drive.fixes,
        stamp_ns=drive.fixes.stamp_ns[kept],
        lat_deg=drive.fixes.lat_deg[kept],
        lon_deg=drive.fixes.lon_deg[kept],
        sigma_m=drive.fixes.sigma_m[kept],
        sequence=drive.fixes.sequence[kept],
    )
    return replace(drive, fixes=fixes)


def withheld_fixes(drive: Drive, withholding: Withholding, frame: MapFrame) -> WithheldFixes:
    """The fixes `without_withheld` takes out, in the map frame."""
    mask = withheld_mask(drive.fixes.stamp_ns, first_stamp_ns(drive), withholding)
    lat_deg, lon_deg = drive.fixes.lat_deg[mask], drive.fixes.lon_deg[mask]
    return WithheldFixes(
        vehicle=drive.vehicle,
        boot_id=drive.boot_id,
        stamp_ns=drive.fixes.stamp_ns[mask],
        point_m=map_points_from_wgs84(lat_deg, lon_deg, frame),
    )


def antenna_errors_m(trajectory: TrajectorySolved, fixes: WithheldFixes) -> Floats:
    """Distances (n,) in m from the path's antenna to the withheld fixes; NaN outside the path's time."""
    return distances_m(antenna_points_m(trajectory, fixes.stamp_ns), fixes.point_m)


def path_differences_m(trajectory: TrajectorySolved, other: TrajectorySolved, at_ns: Ints) -> Floats:
    """Distances (n,) in m between two solutions' antennas at instants (n,)."""
    return distances_m(antenna_points_m(trajectory, at_ns), antenna_points_m(other, at_ns))


@dataclass(frozen=True, slots=True, kw_only=True)
class FilteredPath:
    """A filter's path: stamp_ns (n,), pose (n, 3), antenna_m (n, 2) in the base frame as it then believed it."""

    vehicle: str
    boot_id: str
    stamp_ns: Ints
    pose: Floats
    antenna_m: Floats


def filter_errors_m(path: FilteredPath, fixes: WithheldFixes) -> Floats:
    """Distances (n,) in m from the filter's antenna to fixes it did not see: its newest pose carried on."""
    pose = poses_at(path.stamp_ns, path.pose, at_ns=fixes.stamp_ns)
    if len(path.stamp_ns) == 0:
        return np.full(len(fixes.stamp_ns), np.nan)
    newest = np.clip(np.searchsorted(path.stamp_ns, fixes.stamp_ns, side="right") - 1, 0, None)
    lever_m = path.antenna_m[newest]
    c, s = np.cos(pose[:, 2]), np.sin(pose[:, 2])
    x_m = pose[:, 0] + c * lever_m[:, 0] - s * lever_m[:, 1]
    y_m = pose[:, 1] + s * lever_m[:, 0] + c * lever_m[:, 1]
    return distances_m(np.column_stack([x_m, y_m]), fixes.point_m)


@dataclass(frozen=True, slots=True, kw_only=True)
class GnssEvaluation:
    """How far the withheld fixes lie from what was solved without them; of one vehicle, or of all together.

    `path_difference_m` is between the paths solved with and without the withheld fixes at their instants,
    `path_difference_everywhere_m` at every keyframe; `filter_error_m` is the filter alone on the same fixes.
    `withheld` counts all withheld fixes, `error_m.count` those inside the path's time.
    """

    vehicle: str
    withheld: int
    error_m: ErrorSummary
    path_difference_m: ErrorSummary
    path_difference_everywhere_m: ErrorSummary
    filter_error_m: ErrorSummary


@dataclass(frozen=True, slots=True, kw_only=True)
class WithheldDistances:
    """One drive's distances in m: withheld fix to solved antenna (n,), between the solutions there (n,) and at every
    stamp of the path (k,), and withheld fix to the filter's antenna (n,)."""

    vehicle: str
    error_m: Floats
    difference_m: Floats
    everywhere_m: Floats
    filter_m: Floats


def withheld_distances(
    withheld: Sequence[WithheldFixes],
    *,
    solved: Mapping[DriveName, TrajectorySolved],
    solved_with_all: Mapping[DriveName, TrajectorySolved],
    filtered: Mapping[DriveName, FilteredPath],
) -> tuple[WithheldDistances, ...]:
    """The distances of every drive; of one that was not solved they are unknown."""
    return tuple(
        _distances(fixes, solved.get(name), solved_with_all.get(name), filtered.get(name))
        for fixes in withheld
        for name in [(fixes.vehicle, fixes.boot_id)]
    )


def evaluate_withheld(
    measured: Sequence[WithheldDistances],
) -> tuple[GnssEvaluation, tuple[GnssEvaluation, ...]]:
    """The evaluation of all drives together, and of each vehicle; of several withholdings the fixes are pooled."""
    vehicles = sorted({one.vehicle for one in measured})
    each = tuple(_evaluation(name, [one for one in measured if one.vehicle == name]) for name in vehicles)
    return _evaluation("", measured), each


def _distances(
    fixes: WithheldFixes,
    solved: TrajectorySolved | None,
    solved_with_all: TrajectorySolved | None,
    filtered: FilteredPath | None,
) -> WithheldDistances:
    nothing = np.full(len(fixes.stamp_ns), np.nan)
    both = solved is not None and solved_with_all is not None
    return WithheldDistances(
        vehicle=fixes.vehicle,
        error_m=nothing if solved is None else antenna_errors_m(solved, fixes),
        difference_m=path_differences_m(solved, solved_with_all, fixes.stamp_ns) if both else nothing,  # type: ignore[arg-type]
        everywhere_m=path_differences_m(solved, solved_with_all, solved.stamp_ns) if both else nothing,  # type: ignore[arg-type,union-attr]
        filter_m=nothing if filtered is None else filter_errors_m(filtered, fixes),
    )


def _evaluation(vehicle: str, measured: Sequence[WithheldDistances]) -> GnssEvaluation:
    def joined(name: str) -> ErrorSummary:
        return summary_of(np.concatenate([np.zeros(0), *(getattr(one, name) for one in measured)]))

    return GnssEvaluation(
        vehicle=vehicle,
        withheld=sum(len(one.error_m) for one in measured),
        error_m=joined("error_m"),
        path_difference_m=joined("difference_m"),
        path_difference_everywhere_m=joined("everywhere_m"),
        filter_error_m=joined("filter_m"),
    )
