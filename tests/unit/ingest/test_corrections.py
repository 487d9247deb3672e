"""Anchors retracted, drives excluded and included: appended once, attributed, and undone by what is appended next."""

from dataclasses import replace

import pytest

from event_examples.rows import imu_row
from landmark_maps.examples import label, pin_frame
from trigpoint.errors import InputError
from trigpoint.events.corrected import AnchorLabelled, AnchorRetracted, DriveExcluded, DriveIncluded
from trigpoint.logs.memory_log import MemoryLog
from trigpoint.logs.readings import logged_anchors, logged_corrections
from trigpoint_ingest.anchors import AnchorImportReport, import_anchors
from trigpoint_ingest.core.anchors import LabelledAnchors
from trigpoint_ingest.corrections import (
    Attribution,
    exclude_drives,
    include_drives,
    logged_anchor_standings,
    logged_drive_standings,
    retract_anchor,
)

BY = Attribution(author="surveyor", reason="the pole was moved", stamp_ns=1_700_000_000_000_000_000)
HERE, NORTH = label("a"), replace(label("a", lat_deg=-33.891), image="north")


def imported(log: MemoryLog, *anchors: AnchorLabelled) -> AnchorImportReport:
    return import_anchors(LabelledAnchors(anchors, ()), log)


def log_with(*anchors: AnchorLabelled) -> MemoryLog:
    """Anchors, and two boots of a van."""
    log = MemoryLog()
    pin_frame(log)
    imported(log, *anchors)
    log.append("veh-van", [imu_row(0), imu_row(100, boot_id="boot-2")])
    return log


def test_a_retraction_is_appended_with_who_and_why() -> None:
    log = log_with(HERE)
    report = retract_anchor(log, "a", image=None, by=BY)
    expected = AnchorRetracted(anchor="a", image="tile-1", author="surveyor", reason="the pole was moved")
    assert (report.appended, report.known, report.first_number) == ((expected,), 0, 1)
    assert [row.envelope.stamp_ns for row in log.read("corrections", first_number=1)] == [BY.stamp_ns]
    assert logged_anchors(log) == ()


def test_the_same_retraction_again_changes_nothing() -> None:
    log = log_with(HERE)
    retract_anchor(log, "a", image=None, by=BY)
    report = retract_anchor(log, "a", image=None, by=BY)
    assert (report.appended, report.known, log.next_number("corrections")) == ((), 1, 2)


def test_an_anchor_imported_again_after_its_retraction_is_labelled_anew() -> None:
    log = log_with(HERE)
    retract_anchor(log, "a", image=None, by=BY)
    report = imported(log, HERE)
    assert (report.added, report.known, report.relabelled) == (1, 0, 0)
    assert logged_anchors(log) == (HERE,)


def test_only_the_image_s_own_anchor_is_retracted() -> None:
    log = log_with(HERE, NORTH)
    retract_anchor(log, "a", image="north", by=BY)
    assert logged_anchors(log) == (HERE,)


def test_a_name_in_two_images_has_to_say_which() -> None:
    with pytest.raises(InputError, match=r"labelled in 2 images, 'north', 'tile-1': say --image"):
        retract_anchor(log_with(HERE, NORTH), "a", image=None, by=BY)


def test_a_survey_s_anchor_is_named_by_an_empty_image() -> None:
    log = log_with(HERE, replace(HERE, image="", image_sigma_m=0.0))
    retract_anchor(log, "a", image="", by=BY)
    assert logged_anchors(log) == (HERE,)


def test_an_unknown_anchor_is_refused_with_those_there_are() -> None:
    log = log_with(HERE, label("pole-17"))
    with pytest.raises(InputError, match=r"anchor 'pole-71': .* there are 'pole-17', 'a'"):
        retract_anchor(log, "pole-71", image=None, by=BY)
    with pytest.raises(InputError, match=r"not labelled in image 'south'; it was in 'tile-1'"):
        retract_anchor(log, "a", image="south", by=BY)


def test_a_drive_is_excluded_and_included_again() -> None:
    log = log_with()
    exclude_drives(log, "van", boot_id="boot-2", by=BY)
    assert [one.excluded for one in logged_drive_standings(log)] == [False, True]
    include_drives(log, "van", boot_id="boot-2", by=BY)
    assert [one.excluded for one in logged_drive_standings(log)] == [False, False]
    assert [type(one) for one in logged_corrections(log)] == [DriveExcluded, DriveIncluded]


def test_without_a_boot_all_drives_of_the_vehicle_are_meant() -> None:
    log = log_with()
    exclude_drives(log, "van", boot_id="boot-1", by=BY)
    report = exclude_drives(log, "van", boot_id=None, by=BY)
    assert (len(report.appended), report.known) == (1, 1)
    assert len(include_drives(log, "van", boot_id=None, by=BY).appended) == 2


def test_what_was_included_already_stays_so() -> None:
    log = log_with()
    exclude_drives(log, "van", boot_id="boot-1", by=BY)
    include_drives(log, "van", boot_id="boot-1", by=BY)
    assert include_drives(log, "van", boot_id="boot-1", by=BY).known == 1


def test_a_drive_never_excluded_cannot_be_included() -> None:
    log = log_with()
    exclude_drives(log, "van", boot_id="boot-2", by=BY)
    with pytest.raises(InputError, match=r"'van boot-1': .* excluded are 'van boot-2'"):
        include_drives(log, "van", boot_id="boot-1", by=BY)


def test_an_unknown_drive_is_refused_with_those_there_are() -> None:
    with pytest.raises(InputError, match=r"vehicle 'vann' has no drive in the log; there are 'van'"):
        exclude_drives(log_with(), "vann", boot_id=None, by=BY)
    with pytest.raises(InputError, match=r"no boot 'boot-3'; it has 'boot-1', 'boot-2'|'boot-2', 'boot-1'"):
        exclude_drives(log_with(), "van", boot_id="boot-3", by=BY)


def test_a_list_says_which_anchors_hold_and_why_not() -> None:
    log = log_with(HERE, NORTH)
    retract_anchor(log, "a", image="north", by=BY)
    held, gone = logged_anchor_standings(log)
    assert (held.retracted, gone.retracted and gone.retracted.author) == (None, "surveyor")


def test_a_correction_by_nobody_is_refused() -> None:
    with pytest.raises(InputError, match="author ' ': a correction needs somebody"):
        Attribution(author=" ", reason="", stamp_ns=0)


def test_a_reason_too_long_for_a_name_is_refused_with_the_limit() -> None:
    with pytest.raises(InputError, match="reason of 201 characters, limit 200"):
        Attribution(author="surveyor", reason="x" * 201, stamp_ns=0)
