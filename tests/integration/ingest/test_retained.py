"""What ingest still knows of events that were retained away from its log."""

from contextlib import closing
from pathlib import Path

import pytest

from event_examples.rows import STEP_NS, imu_rows
from trigpoint.events.envelope import EventIdentity
from trigpoint.logs.mcap_log import McapLog
from trigpoint.logs.retention import Keeping, log_files, obstacles, planned_retention, remove_files
from trigpoint.logs.seals import seal_finished
from trigpoint.logs.stream_writer import Rotation
from trigpoint_ingest.core.admission import Admission
from trigpoint_ingest.core.messages import RunMessage
from trigpoint_ingest.recall import admission_from
from trigpoint_ingest.settings import IngestSettings

STREAM = "veh-van"


@pytest.fixture(params=[200, 300], ids=["some", "all"])
def admission(tmp_path: Path, request: pytest.FixtureRequest) -> Admission:
    """What is recalled of 300 events of which the first 200, or all, were retained away."""
    with closing(McapLog(tmp_path, rotation=Rotation(span_ns=99 * STEP_NS, span_least_bytes=0))) as log:
        for first in range(0, 300, 50):
            log.append(STREAM, imu_rows(first, first + 50))
        seal_finished(tmp_path / STREAM)
        held = obstacles(log, {"reader": {STREAM: request.param}}, also_inputs=False)
        remove_files(tmp_path, planned_retention(log_files(log), held, Keeping(total_bytes=0)).removed)
        return admission_from(log, IngestSettings())


@pytest.mark.parametrize("sequence", [0, 199, 200, 299])
def test_an_event_sent_again_is_a_duplicate_whether_it_is_still_there_or_not(
    admission: Admission, sequence: int
) -> None:
    message = RunMessage("trigpoint.v1.ImuMeasured", b"", EventIdentity("van", "boot-1", sequence), 0)
    assert admission.admit(message) is None


def test_everything_up_to_the_newest_is_acknowledged_still(admission: Admission) -> None:
    assert admission.acknowledged(("van", "boot-1")) == 299
