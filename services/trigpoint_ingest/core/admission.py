"""What is in the log already, and what may still come in: the memory of ingest, rebuilt from the log on start."""

from collections.abc import Iterator, Sequence

import numpy as np

from trigpoint.events.codec import event_class
from trigpoint.events.envelope import EncodedMessage, Envelope, EventIdentity
from trigpoint.events.observed import Observed, VehicleDescribed
from trigpoint.events.runs import EncodedRun, Integers
from trigpoint.events.seen import SeenSequences
from trigpoint_ingest.core.stamps import DriveStamps, StampLimits, stamps_fit
from trigpoint_ingest.core.validation import Drive, drive_of, validate

DRIVE_LIMIT = 100_000  # a hundred vehicles for a year, some 50 MB


class Admission:
    """Identities accepted and refused so far, the drives that described themselves, and the times of each."""

    def __init__(
        self,
        *,
        fleet: frozenset[str] | None = None,
        limits: StampLimits | None = None,
        drive_limit: int = DRIVE_LIMIT,
    ) -> None:
        self._fleet = fleet
        self._limits = limits if limits is not None else StampLimits()
        self._accepted = SeenSequences()
        self._refused = SeenSequences()
        self._drive_limit = drive_limit
        self._described: set[Drive] = set()
        self._heard: set[Drive] = set()  # of which nothing was accepted yet
        self._stamps: dict[Drive, DriveStamps] = {}

    def admit(self, message: EncodedMessage) -> Envelope[Observed] | None:
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

    def admit_run(self, run: EncodedRun) -> bool:
        """True if all of a run was admitted as it is; else nothing of it was, and each message is to be looked at.

        The payloads are plainly valid, none a description, the sequences ascending.
        """
        drive = (run.source, run.boot_id)
        stamps = self._stamps.get(drive)
        first, stop = int(run.sequences[0]), int(run.sequences[-1]) + 1
        if drive not in self._described or stamps is None or first < 0:
            return False
        of_sensor = _stamps_of_sensors(run)
        known = self._accepted.overlaps(*drive, start=first, stop=stop)
        if known or not stamps_fit(run.stamps_ns, of_sensor, stamps, self._limits):
            return False
        for start, end in consecutive(run.sequences):
            self._accepted.add_range(*drive, start=start, stop=end)
        stamps.accept_run(run.stamps_ns, of_sensor)
        return True

    def has_all(self, run: EncodedRun) -> bool:
        """Whether every message of a run was accepted before; the sequences are ascending."""
        return all(
            self._accepted.covers(run.source, run.boot_id, start=start, stop=stop)
            for start, stop in consecutive(run.sequences)
        )

    def has_room_for(self, drive: Drive) -> bool:
        """Whether a drive is known, or one more may become so."""
        return drive in self._stamps or drive in self._heard or self._hear(drive)

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

    def recall_run(self, run: EncodedRun) -> None:
        """Events found in the log taken as accepted, without their payloads; a description among them counts."""
        drive = (run.source, run.boot_id)
        for start, stop in consecutive(run.sequences):
            self._accepted.add_range(*drive, start=start, stop=stop)
        of_sensor = _stamps_of_sensors(run)
        if of_sensor.pop(VehicleDescribed, None) is not None:
            self._described.add(drive)
        stamps = self._stamps.setdefault(drive, DriveStamps())
        if of_sensor:
            stamps.accept_run(np.concatenate(list(of_sensor.values())), of_sensor)

    def recall_retained(self, source: str, boot_id: str, ranges: Sequence[tuple[int, int]]) -> None:
        """Events that were in the log and were taken out of it: accepted once, and their drive described."""
        for start, stop in ranges:
            self._accepted.add_range(source, boot_id, start=start, stop=stop)
        self._described.add((source, boot_id))

    def _take(self, envelope: Envelope[Observed], drive: Drive, stamps: DriveStamps) -> None:
        self._accepted.add(envelope.identity)
        self._stamps[drive] = stamps
        self._heard.discard(drive)
        stamps.accept(type(envelope.event), envelope.stamp_ns)
        if type(envelope.event) is VehicleDescribed:
            self._described.add(drive)

    def _hear(self, drive: Drive) -> bool:
        if len(self._stamps) + len(self._heard) >= self._drive_limit:
            return False
        self._heard.add(drive)
        return True


def consecutive(sequences: Integers) -> Iterator[tuple[int, int]]:
    """The half-open stretches without a gap of ascending sequences (n,)."""
    breaks = np.flatnonzero(np.diff(sequences) != 1) + 1
    starts = [0, *breaks.tolist()]
    for start, stop in zip(starts, [*starts[1:], len(sequences)], strict=True):
        yield int(sequences[start]), int(sequences[stop - 1]) + 1


def _stamps_of_sensors(run: EncodedRun) -> dict[type, Integers]:
    if len(run.schemas) == 1:
        kind = event_class(run.schemas[0])
        return {} if kind is None else {kind: run.stamps_ns}
    stamps: dict[type, Integers] = {}
    for number, schema in enumerate(run.schemas):
        kind, own_ns = event_class(schema), run.stamps_ns[run.schema_of_row == number]
        if kind is not None and len(own_ns):
            stamps[kind] = own_ns
    return stamps
