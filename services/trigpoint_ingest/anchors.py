"""Anchors into the log: checked against the map's frame, once each, the refused ones kept aside."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from json import dumps

from trigpoint.errors import FrameRefused
from trigpoint.events.codec import encode, schema_name
from trigpoint.events.corrected import AnchorLabelled
from trigpoint.events.envelope import Envelope, EventIdentity
from trigpoint.events.keys import STREAM_PATTERNS
from trigpoint.events.observed import EventRefused, MapFramePinned
from trigpoint.geodesy.projection import MapFrame
from trigpoint.logs.ports import EventLog
from trigpoint.logs.readings import logged_anchors, logged_frame, pinned_frame
from trigpoint_ingest.core.anchors import (
    ANCHOR_SOURCE,
    LabelledAnchors,
    RefusedAnchor,
    content_name,
    middle_of,
    near_map,
)
from trigpoint_ingest.core.framing import frame_pinned_by
from trigpoint_ingest.core.refusal import REFUSING_SOURCE, SEPARATOR
from trigpoint_ingest.journal import FRAME_IDENTITY, MAP_STREAM, REFUSED_STREAM

CORRECTIONS_STREAM = STREAM_PATTERNS[AnchorLabelled]


@dataclass(frozen=True, slots=True, kw_only=True)
class AnchorImportReport:
    """`added` anchors are new in the log, `known` were there already with the same content, `relabelled` of the
    added ones replace one in force of the same name and image; `refused` ones are kept aside with their reasons.
    """

    added: int
    known: int
    relabelled: int
    refused: tuple[RefusedAnchor, ...]

    def complaints(self) -> tuple[str, ...]:
        """One line for each refused anchor; empty if all went in."""
        return tuple(f"{refused.reason}: {refused.detail}" for refused in self.refused)


def import_anchors(found: LabelledAnchors, log: EventLog, *, stamp_ns: int = 0) -> AnchorImportReport:
    """What came of a file's anchors; `stamp_ns` says when they were labelled, where that is known.

    The first anchors of a map without a frame pin it. Raises AppendFailed if the log cannot be written.
    """
    located = near_map(found.anchors, _frame(found.anchors, log, stamp_ns)) if found.anchors else found
    refused = found.refused + located.refused if found.anchors else found.refused
    in_force = {(anchor.anchor, anchor.image): anchor for anchor in logged_anchors(log)}
    new = [anchor for anchor in located.anchors if in_force.get((anchor.anchor, anchor.image)) != anchor]
    if new:
        log.append(CORRECTIONS_STREAM, _rows(new, stamp_ns, number=log.next_number(CORRECTIONS_STREAM)))
    _keep_aside(refused, log, stamp_ns)
    return AnchorImportReport(
        added=len(new),
        known=len(located.anchors) - len(new),
        relabelled=sum((anchor.anchor, anchor.image) in in_force for anchor in new),
        refused=refused,
    )


def _frame(anchors: Sequence[AnchorLabelled], log: EventLog, stamp_ns: int) -> MapFrame:
    """The map's frame as pinned, or pinned now by the anchor in the middle of these."""
    if pinned_frame(log) is None:
        log.append(MAP_STREAM, [Envelope(FRAME_IDENTITY, stamp_ns, _pinned_by(middle_of(anchors)))])
    return logged_frame(log)


def _pinned_by(anchor: AnchorLabelled) -> MapFramePinned:
    pinned = frame_pinned_by(anchor)
    if pinned is None:
        raise FrameRefused(f"anchor {anchor.anchor!r} pins no frame")
    return pinned


def _rows(anchors: Sequence[AnchorLabelled], stamp_ns: int, *, number: int) -> list[Envelope[AnchorLabelled]]:
    boot_id = content_name((encode(anchor)[1] for anchor in anchors), number=number)
    return [
        Envelope(EventIdentity(ANCHOR_SOURCE, boot_id, sequence), stamp_ns, anchor)
        for sequence, anchor in enumerate(anchors)
    ]


def _keep_aside(refused: Sequence[RefusedAnchor], log: EventLog, stamp_ns: int) -> None:
    """The refused anchors in the stream of refusals, each once however often it is imported."""
    kept = {row.envelope.event for row in log.read(REFUSED_STREAM, kinds=(EventRefused,))} if refused else set()
    new = [event for event in dict.fromkeys(_refusal(anchor) for anchor in refused) if event not in kept]
    if new:
        boot_id = content_name((event.payload for event in new), number=log.next_number(REFUSED_STREAM))
        named = f"{ANCHOR_SOURCE}{SEPARATOR}{boot_id}"
        log.append(
            REFUSED_STREAM,
            [
                Envelope(EventIdentity(REFUSING_SOURCE, named, sequence), stamp_ns, event)
                for sequence, event in enumerate(new)
            ],
        )


def _refusal(refused: RefusedAnchor) -> EventRefused:
    return EventRefused(
        source=ANCHOR_SOURCE,
        reason=refused.reason,
        detail=refused.detail,
        schema_name=schema_name(AnchorLabelled),
        payload=dumps(asdict(refused.row), sort_keys=True).encode(),
    )
