"""A drive's loops closed: each place proposed by constellations is verified by the points of both times."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trigpoint.errors import EventRejected
from trigpoint.events.perceived import LoopClosed
from trigpoint_perception.core.closures.clouds import Cloud
from trigpoint_perception.core.closures.proposals import Proposal, proposals
from trigpoint_perception.core.closures.runs import Run
from trigpoint_perception.core.closures.settings import ClosureSettings
from trigpoint_perception.core.closures.submaps import Submap
from trigpoint_perception.core.closures.verification import Verification, verified

Floats = NDArray[np.float64]
CloudAt = Callable[[Run, int], Cloud]


@dataclass(frozen=True, slots=True, kw_only=True)
class Attempt:
    """What became of one proposal: the closure with its stamp, or why there is none."""

    stamp_ns: int
    closed: LoopClosed | None
    refusal: str


def attempts(
    ones: Sequence[Submap], others: Iterable[Sequence[Submap]], cloud_at: CloudAt, settings: ClosureSettings
) -> Iterator[Attempt]:
    """Every place proposed for a drive's submaps among those of several drives, verified or refused with the reason;
    those close to a closure that is verified already are passed over.

    `cloud_at` gives the points around a sweep of a run; it may raise EventRejected.
    """
    closed: list[Proposal] = []
    for proposal in proposals(ones, others, settings):
        if any(_is_beside(proposal, each, settings.constellation.spacing_m) for each in closed):
            continue
        attempt = _attempt(proposal, cloud_at, settings)
        if attempt.closed is not None:
            closed.append(proposal)
        yield attempt


def _is_beside(proposal: Proposal, closed: Proposal, spacing_m: float) -> bool:
    """Whether both are of the same runs, and either of their sweeps are near one another on these."""
    if proposal.run is not closed.run or proposal.other is not closed.other:
        return False
    apart_m = abs(proposal.run.path_m[proposal.row] - closed.run.path_m[closed.row])
    other_apart_m = abs(proposal.other.path_m[proposal.other_row] - closed.other.path_m[closed.other_row])
    return bool(apart_m < spacing_m and other_apart_m < 2.0 * spacing_m)


def _attempt(proposal: Proposal, cloud_at: CloudAt, settings: ClosureSettings) -> Attempt:
    stamp_ns = int(proposal.run.stamp_ns[proposal.row])
    if proposal.refusal:
        return Attempt(stamp_ns=stamp_ns, closed=None, refusal=proposal.refusal)
    try:
        one, other = cloud_at(proposal.run, proposal.row), cloud_at(proposal.other, proposal.other_row)
    except EventRejected as error:
        return Attempt(stamp_ns=stamp_ns, closed=None, refusal=str(error).partition(":")[0])
    found = verified(one, other, proposal.T_other_one, settings.verification)
    closed = None if found.refusal else _closure(proposal, found)
    return Attempt(stamp_ns=stamp_ns, closed=closed, refusal=found.refusal)


def _closure(proposal: Proposal, found: Verification) -> LoopClosed:
    run, other = proposal.run, proposal.other
    return LoopClosed(
        vehicle=run.vehicle,
        boot_id=run.boot_id,
        sensor=run.sensor,
        sweep_sequence=int(run.sequence[proposal.row]),
        other_vehicle=other.vehicle,
        other_boot_id=other.boot_id,
        other_sensor=other.sensor,
        other_sequence=int(other.sequence[proposal.other_row]),
        other_stamp_ns=int(other.stamp_ns[proposal.other_row]),
        x_m=float(found.T_other_one[0]),
        y_m=float(found.T_other_one[1]),
        heading_rad=float(found.T_other_one[2]),
        covariance=found.covariance,
        matched_share=found.matched_share,
        pairs=proposal.pairs,
    )
