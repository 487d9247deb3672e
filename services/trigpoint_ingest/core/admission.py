"""What is in the log already, and what may still come in: the memory of ingest, rebuilt from the log on start."""

from trigpoint.events.envelope import Envelope, EventIdentity
from trigpoint.events.observed import Observed, VehicleDescribed
from trigpoint.events.seen import SeenSequences
from trigpoint_ingest.core.messages import RawMessage
from trigpoint_ingest.core.stamps import DriveStamps, StampLimits
from trigpoint_ingest.core.validation import Drive, drive_of, validate


class Admission:
    """Identities accepted and refused so far, the drives that described themselves, and the times of each."""

    def __init__(self, *, fleet: frozenset[str] | None = None, limits: StampLimits | None = None) -> None:
        self._fleet = fleet
        self._limits = limits if limits is not None else StampLimits()
        self._accepted = SeenSequences()
        self._refused = SeenSequences()
        self._described: set[Drive] = set()
        self._stamps: dict[Drive, DriveStamps] = {}

    def admit(self, message: RawMessage) -> Envelope[Observed] | None:
        """The event to be logged, or None for a duplicate. Raises EventRejected.

        A message refused once is looked at afresh when it comes again: what was wrong may have been mended.
        """
        identity = message.identity
        if identity in self._accepted:
            return None
        drive = drive_of(identity)
        stamps = self._stamps.get(drive)
        if stamps is None:
            stamps = DriveStamps()
        envelope = validate(
            message, described=drive in self._described, stamps=stamps, limits=self._limits, fleet=self._fleet
        )
        self._take(envelope, drive, stamps)
        return envelope

    def refuse(self, identity: EventIdentity) -> bool:
        """True if this identity was not refused before: only then is the refusal worth keeping."""
        return self._refused.add(identity)

    def recall(self, envelope: Envelope[Observed]) -> None:
        """An event found in the log taken as accepted."""
        drive = drive_of(envelope.identity)
        self._take(envelope, drive, self._stamps.get(drive) or DriveStamps())

    def acknowledged(self, drive: Drive) -> int:
        """The highest sequence up to which every message of the drive was accepted or refused; -1 for none."""
        reached = 0
        for start, stop in sorted(self._accepted.ranges(*drive) + self._refused.ranges(*drive)):
            if start > reached:
                break
            reached = max(reached, stop)
        return reached - 1

    def _take(self, envelope: Envelope[Observed], drive: Drive, stamps: DriveStamps) -> None:
        self._accepted.add(envelope.identity)
        self._stamps[drive] = stamps
        stamps.accept(type(envelope.event), envelope.stamp_ns)
        if type(envelope.event) is VehicleDescribed:
            self._described.add(drive)
