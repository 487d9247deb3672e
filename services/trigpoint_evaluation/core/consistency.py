"""Whether the filter's gate does what it claims: NIS against its bounds, verdicts against what fixes truly were."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from trigpoint.events.drives import Drive
from trigpoint.events.estimated import FixJudged
from trigpoint.events.truth import TruthFixes

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]

CONFIDENCE = 0.95
CLEAR, CAR_PARK = "clear", "car park"  # states of simulated fixes


@dataclass(frozen=True, slots=True, kw_only=True)
class JudgedFixes:
    """The verdicts (n,) on one drive's fixes, in order of time: stamps, NIS (NaN where there was none), acceptance."""

    vehicle: str
    boot_id: str
    stamp_ns: Ints
    nis: Floats
    limit: Floats
    accepted: Flags
    reason: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class NisSummary:
    """NIS of the fixes that were accepted, which a sound filter draws from chi-squared cut off at the gate, and of all.

    `mean` over accepted ones and the 95 % interval [`mean_low`, `mean_high`] of that mean if they were independent
    draws; `share_inside` of all fixes with a NIS that lie inside the gate.
    """

    vehicle: str
    judged: int
    accepted: int
    mean: float
    mean_low: float
    mean_high: float
    share_inside: float


@dataclass(frozen=True, slots=True, kw_only=True)
class GateTruth:
    """Verdicts against truth: fixes from inside a car park that were accepted, and good ones that were rejected.

    Good fixes are those truly "clear"; after re-acquisition means after the first accepted fix that follows the
    drive's last one from inside a car park (all good fixes, where no car park was). Shares are NaN without fixes.
    """

    car_park_fixes: int
    car_park_accepted: int
    good_fixes: int
    good_rejected: int
    good_after: int
    good_rejected_after: int

    @property
    def good_rejected_share(self) -> float:
        """Rejected ones among the good fixes after re-acquisition."""
        return self.good_rejected_after / self.good_after if self.good_after else float("nan")


def judged_fixes(drive: Drive, verdicts: Sequence[FixJudged]) -> JudgedFixes:
    """A drive's verdicts beside its fixes' stamps; fixes without a verdict are left out."""
    mine = {one.fix_sequence: one for one in verdicts if (one.vehicle, one.boot_id) == (drive.vehicle, drive.boot_id)}
    pairs = [
        (stamp, mine[sequence])
        for stamp, sequence in zip(drive.fixes.stamp_ns.tolist(), drive.fixes.sequence.tolist(), strict=True)
        if sequence in mine
    ]
    return JudgedFixes(
        vehicle=drive.vehicle,
        boot_id=drive.boot_id,
        stamp_ns=np.array([stamp for stamp, _ in pairs], dtype=np.int64),
        nis=np.array([one.nis for _, one in pairs], dtype=np.float64),
        limit=np.array([one.limit for _, one in pairs], dtype=np.float64),
        accepted=np.array([one.accepted for _, one in pairs], dtype=bool),
        reason=tuple(one.reason for _, one in pairs),
    )


def nis_summary(judged: JudgedFixes) -> NisSummary:
    """The drive's NIS against what chi-squared with 2 degrees of freedom, cut off at the gate, would give."""
    known = np.isfinite(judged.nis)
    inside = known & (judged.nis <= judged.limit)
    nis = judged.nis[judged.accepted & inside]
    limit = float(np.median(judged.limit[known])) if known.any() else float("nan")
    mean, deviation = cut_off_moments(limit)
    reach = float(chi2.ppf(CONFIDENCE, 1)) ** 0.5 * deviation / np.sqrt(max(len(nis), 1))
    return NisSummary(
        vehicle=judged.vehicle,
        judged=len(judged.nis),
        accepted=int(np.count_nonzero(judged.accepted)),
        mean=float(np.mean(nis)) if len(nis) else float("nan"),
        mean_low=mean - reach,
        mean_high=mean + reach,
        share_inside=float(np.count_nonzero(inside) / np.count_nonzero(known)) if known.any() else float("nan"),
    )


def cut_off_moments(limit: float) -> tuple[float, float]:
    """Mean and standard deviation of chi-squared with 2 degrees of freedom, given it is at most `limit`.

    Its density is exp(-x / 2) / 2, so both follow by integrating by parts.
    """
    tail = np.exp(-0.5 * limit)
    kept = 1.0 - tail
    mean = (2.0 - tail * (limit + 2.0)) / kept
    second = (8.0 - tail * (limit**2 + 4.0 * limit + 8.0)) / kept
    return float(mean), float(np.sqrt(max(second - mean**2, 0.0)))


def gate_truth(judged: Sequence[JudgedFixes], truth: Sequence[TruthFixes]) -> GateTruth:
    """What the gates of all drives did, where the truth of their fixes is known."""
    states = {fixes.vehicle: dict(zip(fixes.stamp_ns.tolist(), fixes.state, strict=True)) for fixes in truth}
    counts = np.zeros(6, dtype=np.int64)
    for one in judged:
        counts += _counts(one, states.get(one.vehicle, {}))
    return GateTruth(
        car_park_fixes=int(counts[0]),
        car_park_accepted=int(counts[1]),
        good_fixes=int(counts[2]),
        good_rejected=int(counts[3]),
        good_after=int(counts[4]),
        good_rejected_after=int(counts[5]),
    )


def _counts(judged: JudgedFixes, states: dict[int, str]) -> Ints:
    state = np.array([states.get(stamp, "") for stamp in judged.stamp_ns.tolist()], dtype=object)
    parked, good = state == CAR_PARK, state == CLEAR
    after = good & (np.arange(len(state)) > _rejoined_at(parked, judged.accepted))
    flags = (parked, parked & judged.accepted, good, good & ~judged.accepted, after, after & ~judged.accepted)
    return np.array([np.count_nonzero(flag) for flag in flags], dtype=np.int64)


def _rejoined_at(parked: Flags, accepted: Flags) -> int:
    """The number of the first accepted fix after the last one from inside a car park; -1 where there was none."""
    if not parked.any():
        return -1
    left = int(np.flatnonzero(parked)[-1])
    following = np.flatnonzero(accepted[left + 1 :])
    return left + 1 + int(following[0]) if len(following) else len(accepted)
