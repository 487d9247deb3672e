"""Two hypotheses of where a vehicle is: the one it reports, and one that grows from fixes that contradict it.

The second takes over only when its evidence outweighs the first's, and the first may come back.
"""

import math
from dataclasses import replace

import numpy as np

from trigpoint.errors import AlignmentRefused
from trigpoint.events.estimated import GateAlarmed
from trigpoint.geodesy.poses import Pose2
from trigpoint_filtering.core.following import Track, antenna_pose, grown, told
from trigpoint_filtering.core.gate import (
    REACQUIRED,
    RUN_FIXES,
    SECONDS_PER_NS,
    Fix,
    Hypothesis,
    Verdict,
    drift_bound_m,
    has_lost_heading,
    judged,
)
from trigpoint_filtering.core.initialisation import Seeker, after_pair
from trigpoint_filtering.core.motion import HEADING, X, Y

SUPPORT_S = (30.0, 120.0)  # a second hypothesis needs as much as the first had, within these bounds
NEAR_SUPPORT_S = 25.0  # for one that the first may have drifted from
SUPPORT_FIXES_PER_S = 0.3  # accepted, of those seconds
ALTERNATE_REJECTIONS = 10  # in a row end a second hypothesis
FORMER_KEPT_S = 300.0  # a deposed hypothesis may come back for this long
DEAF_S = 60.0  # of rejections only
DEAF_FIXES = 20
GATE_USELESS_M = 100.0  # radius of a gate that could reject next to nothing
DEAF_REASON = "every fix rejected"
USELESS_REASON = "gate too wide to reject"


def gated(track: Track, hypothesis: Hypothesis, fix: Fix, sequence: int) -> Track:
    """The track after its hypotheses have judged a fix."""
    following = track.following
    after, verdict = judged(hypothesis, fix, following.estimator, limit=following.limit)
    track = told(replace(track, hypothesis=after), verdict, sequence)
    if track.deposed_ns:
        track = _with_former(track, fix, verdict)
    elif verdict.accepted:
        track = replace(track, alternate=None, seeker=None)
    else:
        track = _with_alternate(track, after, fix)
    return _alarmed(track, verdict, fix.stamp_ns)


def _with_alternate(track: Track, hypothesis: Hypothesis, fix: Fix) -> Track:
    """The track with its second hypothesis fed the fix that the first rejected."""
    if track.alternate is None:
        return _with_seeker(track, hypothesis, fix)
    following = track.following
    alternate, _ = judged(track.alternate, fix, following.estimator, limit=following.limit)
    if alternate.rejected_count >= ALTERNATE_REJECTIONS:
        return replace(track, alternate=None, seeker=None)
    if not _outweighs(alternate, hypothesis):
        return replace(track, alternate=alternate)
    return _swapped(track, alternate, hypothesis, fix)


def _swapped(track: Track, chosen: Hypothesis, deposed: Hypothesis, fix: Fix) -> Track:
    assert track.verdict is not None
    verdict = replace(track.verdict, accepted=True, reason=REACQUIRED)
    return replace(track, hypothesis=chosen, alternate=deposed, deposed_ns=fix.stamp_ns, seeker=None, verdict=verdict)


def _with_seeker(track: Track, hypothesis: Hypothesis, fix: Fix) -> Track:
    """The track with the rejected fix laid along the way driven since rejections began."""
    mean = hypothesis.belief.mean
    seeker = track.seeker or Seeker(Pose2(float(mean[X]), float(mean[Y]), float(mean[HEADING])))
    seeker = after_pair(seeker, fix.point_m, antenna=antenna_pose(track))
    try:
        alternate = grown(track, seeker, fix, hypothesis.belief)
    except AlignmentRefused:
        return replace(track, seeker=seeker)
    return replace(track, seeker=None, alternate=alternate)


def _outweighs(alternate: Hypothesis, hypothesis: Hypothesis) -> bool:
    """Whether the second hypothesis has agreed with the fixes for long, and the first with none meanwhile.

    Where the first has lost its heading or may have drifted to the second, a short agreement is enough; else it
    must be as long as the first's own was, within bounds.
    """
    had_s = (hypothesis.accepted_ns - hypothesis.born_ns) * SECONDS_PER_NS
    needed_s = min(max(had_s, SUPPORT_S[0]), SUPPORT_S[1])
    if has_lost_heading(hypothesis) or _is_near(alternate, hypothesis):
        needed_s = NEAR_SUPPORT_S
    support_s = (alternate.accepted_ns - alternate.born_ns) * SECONDS_PER_NS
    alone = hypothesis.accepted_ns <= alternate.born_ns
    return alone and support_s >= needed_s and alternate.accepted_count >= needed_s * SUPPORT_FIXES_PER_S


def _is_near(alternate: Hypothesis, hypothesis: Hypothesis) -> bool:
    sigma_m = math.sqrt(float(hypothesis.belief.covariance.diagonal()[X : Y + 1].max()))
    apart_m = float(np.hypot(*(alternate.belief.mean[X : Y + 1] - hypothesis.belief.mean[X : Y + 1])))
    return apart_m <= drift_bound_m(hypothesis, sigma_m)


def _with_former(track: Track, fix: Fix, verdict: Verdict) -> Track:
    """The track with its deposed hypothesis kept, brought back or let go."""
    former, following = track.alternate, track.following
    if former is None or (fix.stamp_ns - track.deposed_ns) * SECONDS_PER_NS > FORMER_KEPT_S:
        return replace(track, alternate=None, deposed_ns=0)
    after, former_verdict = judged(former, fix, following.estimator, limit=following.limit)
    assert track.hypothesis is not None
    if former_verdict.accepted and track.hypothesis.rejected_count >= RUN_FIXES:
        track = _swapped(track, after, track.hypothesis, fix)
        return replace(track, alternate=None, deposed_ns=0)
    if former_verdict.accepted and verdict.accepted:
        return replace(track, alternate=None, deposed_ns=0)
    return replace(track, alternate=after)


def _alarmed(track: Track, verdict: Verdict, stamp_ns: int) -> Track:
    """The track with an alarm if the gate has become deaf or useless, once until a fix is accepted."""
    hypothesis = track.hypothesis
    assert hypothesis is not None
    if verdict.accepted and verdict.gate_radius_m < GATE_USELESS_M:
        return replace(track, alarmed=())
    duration_s = (stamp_ns - hypothesis.accepted_ns) * SECONDS_PER_NS
    reasons = (
        (DEAF_REASON, duration_s >= DEAF_S and hypothesis.rejected_count >= DEAF_FIXES),
        (USELESS_REASON, verdict.gate_radius_m >= GATE_USELESS_M),
    )
    fresh = [reason for reason, holds in reasons if holds and reason not in track.alarmed]
    if not fresh:
        return track
    said = GateAlarmed(
        vehicle=track.following.vehicle, boot_id=track.following.boot_id, reason=fresh[0], duration_s=duration_s
    )
    return replace(track, alarm=said, alarmed=(*track.alarmed, fresh[0]))
