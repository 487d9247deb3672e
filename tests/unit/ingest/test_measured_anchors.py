"""What is measured in an image takes the place of what was measured there before, and of nothing else."""

from dataclasses import replace

from landmark_maps.examples import label, pin_frame
from trigpoint.geodesy.projection import WGS84
from trigpoint.logs.memory_log import MemoryLog
from trigpoint.logs.readings import logged_anchors
from trigpoint_ingest.anchors import import_anchors
from trigpoint_ingest.core.anchors import AnchorRow, LabelledAnchors
from trigpoint_ingest.corrections import Attribution
from trigpoint_ingest.measured_anchors import MeasuredReport, replace_measured

BY = Attribution(author="surveyor", reason="measured in north", stamp_ns=1_700_000_000_000_000_000)
BY_HAND = replace(label("pole-1"), image="north")


def row(landmark: str, *, north_deg: float = 0.0) -> AnchorRow:
    return AnchorRow(
        anchor=landmark, x=BY_HAND.lon_deg, y=BY_HAND.lat_deg + north_deg, crs=WGS84, sigma_m=0.2, image_sigma_m=0.35
    )


def measured(log: MemoryLog, *rows: AnchorRow, image: str = "north") -> MeasuredReport:
    return replace_measured(log, rows, image=image, by=BY)


def log_with_a_label() -> MemoryLog:
    log = MemoryLog()
    pin_frame(log)
    import_anchors(LabelledAnchors((BY_HAND,), ()), log)
    return log


def names(log: MemoryLog) -> set[tuple[str, str]]:
    return {(one.anchor, one.image) for one in logged_anchors(log)}


def test_what_is_measured_again_is_measured_anew_and_what_is_not_is_retracted() -> None:
    log = log_with_a_label()
    measured(log, row("pole-1"), row("pole-2"))
    report = measured(log, row("pole-1", north_deg=1e-6))
    assert (report.imported.relabelled, len(report.retracted.appended)) == (1, 1)
    assert names(log) == {("pole-1", "north"), ("measured/pole-1", "north")}


def test_what_was_measured_in_another_image_stays() -> None:
    log = log_with_a_label()
    measured(log, row("pole-1"), image="south")
    measured(log, row("pole-1"))
    assert names(log) == {("pole-1", "north"), ("measured/pole-1", "south"), ("measured/pole-1", "north")}


def test_the_same_measurement_again_changes_nothing() -> None:
    log = log_with_a_label()
    measured(log, row("pole-1"))
    number = log.next_number("corrections")
    measured(log, row("pole-1"))
    assert log.next_number("corrections") == number
