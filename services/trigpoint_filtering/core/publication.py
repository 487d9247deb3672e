"""What a track gives out: every verdict and alarm, and poses at a bounded rate, numbered as events."""

import hashlib
from collections.abc import Iterable
from dataclasses import dataclass

from trigpoint.events.drives import Drive
from trigpoint.events.envelope import Envelope, EventIdentity
from trigpoint.events.estimated import Estimated, FixJudged, PoseFiltered
from trigpoint.geodesy.poses import wrap_angle_rad
from trigpoint.geodesy.projection import MapFrame
from trigpoint_filtering.core.estimator import Belief, pose_covariance
from trigpoint_filtering.core.following import Track, base_speed_mps
from trigpoint_filtering.core.motion import HEADING, X, Y
from trigpoint_filtering.settings import FilterSettings

SOURCE = "filtering"
WHOLE_WITHIN_NS = 1_000_000_000  # of a drive's end: poses come several times a second


@dataclass(frozen=True, slots=True)
class Published:
    """How far publication has come: events given out, and the stamp of the newest pose among them."""

    boot_id: str
    count: int = 0
    pose_ns: int = -1


def output_boot_id(vehicle: str, boot_id: str, frame: MapFrame, settings: FilterSettings) -> str:
    """The boot under which a drive's estimates are numbered: the same for the same drive, frame and settings."""
    digest = hashlib.sha256(f"{vehicle}|{boot_id}|{frame}|{settings}".encode()).hexdigest()[:12]
    return f"{vehicle}-{digest}"


def published(
    track: Track, before: Published, settings: FilterSettings
) -> tuple[tuple[Envelope[Estimated], ...], Published]:
    """The events a track has to give out since `before`, and how far that brings publication."""
    told: list[tuple[int, Estimated]] = []
    if track.verdict is not None:
        told.append((track.fix_ns, track.verdict))
    if track.alarm is not None:
        told.append((track.fix_ns, track.alarm))
    pose_ns = before.pose_ns
    if track.hypothesis is not None and _is_pose_due(track.believed_ns, before.pose_ns, settings):
        pose_ns = track.believed_ns
        told.append((pose_ns, _pose(track, track.hypothesis.belief)))
    rows = tuple(
        Envelope(EventIdentity(SOURCE, before.boot_id, before.count + number), stamp_ns, event)
        for number, (stamp_ns, event) in enumerate(told)
    )
    return rows, Published(before.boot_id, before.count + len(rows), pose_ns)


def _is_pose_due(stamp_ns: int, newest_ns: int, settings: FilterSettings) -> bool:
    return newest_ns < 0 or stamp_ns - newest_ns >= round(settings.pose_interval_s * 1e9)


def _pose(track: Track, belief: Belief) -> PoseFiltered:
    return PoseFiltered(
        vehicle=track.following.vehicle,
        boot_id=track.following.boot_id,
        x_m=float(belief.mean[X]),
        y_m=float(belief.mean[Y]),
        heading_rad=wrap_angle_rad(float(belief.mean[HEADING])),
        speed_mps=base_speed_mps(track),
        covariance=pose_covariance(belief.covariance),
    )


@dataclass(frozen=True, slots=True)
class Said:
    """What of a drive's estimates is there already: events, verdicts and accepted ones, poses, newest pose."""

    count: int = 0
    verdicts: int = 0
    accepted: int = 0
    poses: int = 0
    pose_ns: int = -1

    def with_row(self, row: Envelope[Estimated]) -> "Said":
        """The same with one more event."""
        event = row.event
        judged = isinstance(event, FixJudged)
        posed = isinstance(event, PoseFiltered)
        return Said(
            self.count + 1,
            self.verdicts + judged,
            self.accepted + (isinstance(event, FixJudged) and event.accepted),
            self.poses + posed,
            max(self.pose_ns, row.stamp_ns) if posed else self.pose_ns,
        )

    def with_rows(self, rows: Iterable[Envelope[Estimated]]) -> "Said":
        """The same with more events."""
        said = self
        for row in rows:
            said = said.with_row(row)
        return said

    def is_whole(self, drive: Drive) -> bool:
        """Whether every fix of a drive has its verdict and poses reach its last wheel sample."""
        if self.poses == 0 or self.verdicts < len(drive.fixes.stamp_ns) or len(drive.wheels.stamp_ns) == 0:
            return False
        return int(drive.wheels.stamp_ns[-1]) - self.pose_ns <= WHOLE_WITHIN_NS


UNSAID = Said()
