"""Messages admitted together are admitted as they would be one after the other."""

from collections.abc import Sequence

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from trigpoint.errors import EventRejected
from trigpoint.events.codec import encode, schema_name
from trigpoint.events.envelope import Envelope, EventIdentity
from trigpoint.events.observed import ImuMeasured, VehicleDescribed, WheelPairMeasured
from trigpoint.events.runs import EncodedRun
from trigpoint_ingest.core.admission import Admission
from trigpoint_ingest.core.messages import messages_of
from trigpoint_ingest.core.rates import MessageAllowance
from trigpoint_ingest.core.stamps import StampLimits

T0_NS = 1_700_000_000_000_000_000
NS_PER_S = 1_000_000_000
DRIVE = ("van", "boot-1")
LIMITS = StampLimits(backwards_tolerance_s=5.0, jump_limit_s=30.0)
EVENTS = (
    ImuMeasured(yaw_rate_radps=0.1, acceleration_x_mps2=0.1, acceleration_y_mps2=0.1),
    WheelPairMeasured(left_mps=1.0, right_mps=1.0),
)


def admission() -> Admission:
    """Of a drive that has described itself, and said one thing."""
    found = Admission(limits=LIMITS)
    found.recall(Envelope(EventIdentity(*DRIVE, 0), T0_NS, VehicleDescribed(vehicle="van")))
    found.recall(Envelope(EventIdentity(*DRIVE, 1), T0_NS, EVENTS[0]))
    return found


def run(rows: Sequence[tuple[int, int]], *, first: int = 2) -> EncodedRun:
    """Messages of a kind and a time in s each."""
    return EncodedRun(
        source="van",
        boot_id="boot-1",
        schemas=tuple(schema_name(type(event)) for event in EVENTS),
        schema_of_row=np.array([kind for kind, _ in rows], dtype=np.int64),
        sequences=np.arange(first, first + len(rows), dtype=np.int64),
        stamps_ns=np.array([T0_NS + at_s * NS_PER_S for _, at_s in rows], dtype=np.int64),
        payloads=[encode(EVENTS[kind])[1] for kind, _ in rows],
    )


def are_all_admitted(found: Admission, messages: EncodedRun) -> bool:
    """Whether each of them is, one after the other."""
    try:
        return None not in [found.admit(message) for message in messages_of(messages)]
    except EventRejected:
        return False


TIMES = st.lists(st.tuples(st.integers(0, 1), st.integers(-40, 80)), min_size=1, max_size=8)


@given(TIMES, TIMES)
def test_a_run_is_admitted_whole_just_when_each_message_is(
    first: list[tuple[int, int]], second: list[tuple[int, int]]
) -> None:
    together, one_by_one = admission(), admission()
    for rows, start in ((first, 2), (second, 2 + len(first))):
        expected = are_all_admitted(one_by_one, run(rows, first=start))
        assert together.admit_run(run(rows, first=start)) == expected
        if not expected:
            return
        assert together.acknowledged(DRIVE) == one_by_one.acknowledged(DRIVE) == start + len(rows) - 1


def test_a_run_with_a_known_message_is_not_admitted_whole() -> None:
    found = admission()
    assert not found.admit_run(run([(0, 1), (0, 2)], first=1))
    assert found.acknowledged(DRIVE) == 1


def test_a_run_of_a_drive_that_did_not_describe_itself_is_not_admitted_whole() -> None:
    assert not Admission().admit_run(run([(0, 1)]))


def test_a_run_that_was_admitted_is_known() -> None:
    found = admission()
    found.admit_run(run([(0, 1), (1, 2)]))
    assert found.has_all(run([(0, 1), (1, 2)]))
    assert not found.has_all(run([(0, 1), (1, 2), (0, 3)]))


def test_what_is_recalled_by_runs_is_known_and_its_drive_described() -> None:
    found = Admission()
    described = run([(0, 0)], first=0)
    of_description = EncodedRun(
        source="van",
        boot_id="boot-1",
        schemas=(schema_name(VehicleDescribed),),
        schema_of_row=described.schema_of_row,
        sequences=described.sequences,
        stamps_ns=described.stamps_ns,
        payloads=(),
    )
    found.recall_run(of_description)
    found.recall_run(run([(0, 1), (1, 2)], first=1))
    assert found.acknowledged(DRIVE) == 2
    assert found.admit_run(run([(0, 3)], first=3))


def test_an_allowance_is_used_up_and_fills_again_with_time() -> None:
    allowance = MessageAllowance(rate_hz=10.0, burst=20, now_s=0.0)
    assert [allowance.take(15, now_s=0.0), allowance.take(15, now_s=0.0), allowance.take(15, now_s=1.0)] == [15, 5, 10]


def test_an_allowance_saves_up_no_more_than_its_burst() -> None:
    assert MessageAllowance(rate_hz=10.0, burst=20, now_s=0.0).take(1000, now_s=3600.0) == 20
