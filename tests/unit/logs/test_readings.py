"""What a log holds, folded into values."""

from event_examples.rows import START_NS
from landmark_maps.examples import label
from trigpoint.events.corrected import AnchorRetracted, Corrected
from trigpoint.events.envelope import Envelope, EventIdentity
from trigpoint.logs.memory_log import MemoryLog
from trigpoint.logs.readings import logged_anchors


def _log_of(*corrections: Corrected) -> MemoryLog:
    log = MemoryLog()
    rows = [Envelope(EventIdentity("ingest", "boot-1", n), START_NS, event) for n, event in enumerate(corrections)]
    log.append("corrections", rows)
    return log


def _retracted(anchor: str) -> AnchorRetracted:
    return AnchorRetracted(anchor=anchor, image=label(anchor).image, author="surveyor", reason="moved")


def test_a_retracted_anchor_is_in_force_no_more() -> None:
    log = _log_of(label("a"), label("b"), _retracted("a"))
    assert logged_anchors(log) == (label("b"),)


def test_an_anchor_labelled_again_after_its_retraction_is_in_force() -> None:
    log = _log_of(label("a"), _retracted("a"), label("a"))
    assert logged_anchors(log) == (label("a"),)
