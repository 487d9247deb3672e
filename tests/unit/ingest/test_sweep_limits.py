"""What a sweep must be to enter the log: each refusal names the value and the limit."""

import math
from dataclasses import replace

import numpy as np
import pytest

from event_examples.any_event import same_event
from event_examples.one_each import EVENTS
from trigpoint.errors import EventRejected
from trigpoint.events.codec import encode, schema_name
from trigpoint.events.envelope import EventIdentity
from trigpoint.events.observed import EventRefused, Observed, VehicleDescribed
from trigpoint.events.scanned import PointsScanned
from trigpoint.logs.memory_log import MemoryLog
from trigpoint.logs.vehicle_log import RawMessage
from trigpoint_ingest.core.limits import within_limits
from trigpoint_ingest.core.plain_payloads import PlainPayloads
from trigpoint_ingest.core.sweep_limits import POINTS_LIMIT
from trigpoint_ingest.journal import Journal
from trigpoint_ingest.settings import IngestSettings

SWEEP = next(event for event in EVENTS if isinstance(event, PointsScanned))
STAMP_NS = 1_700_000_000_000_000_000


def refused(sweep: PointsScanned) -> tuple[str, str]:
    with pytest.raises(EventRejected) as caught:
        within_limits(sweep)
    return caught.value.reason, caught.value.detail


def sweep_of(count: int, *, value: float = 1.0) -> PointsScanned:
    return replace(
        SWEEP,
        point_m=np.full((count, 3), value, dtype=np.float32),
        intensity=np.zeros(count, dtype=np.float32),
        offset_ns=np.zeros(count, dtype=np.int32),
        ring=np.zeros(count, dtype=np.uint16),
    )


def with_offset(offset_ns: int) -> PointsScanned:
    return replace(SWEEP, offset_ns=np.array([0, offset_ns], dtype=np.int32))


def test_a_sweep_with_points_that_did_not_come_back_is_taken_as_it_is() -> None:
    assert within_limits(SWEEP) is SWEEP


@pytest.mark.parametrize("sweep", [sweep_of(0), sweep_of(7, value=math.nan)], ids=["no point", "no return"])
def test_a_sweep_without_a_measured_point_is_empty(sweep: PointsScanned) -> None:
    count = len(sweep.point_m)
    assert refused(sweep) == ("empty sweep", f"none of {count} points was measured: a sweep has at least 1")


def test_a_sweep_of_too_many_points_is_refused_with_their_number_and_the_limit() -> None:
    count = POINTS_LIMIT + 1
    assert refused(sweep_of(count)) == ("too many points", f"{count} points in a sweep, limit {POINTS_LIMIT}")


def test_a_sensor_far_from_its_vehicle_is_refused() -> None:
    reason, detail = refused(replace(SWEEP, sensor_position_m=np.array([0.0, 20.1, 0.0])))
    assert (reason, detail) == ("wrong extrinsics", "'roof' at 0, 20.1, 0 m, 20.1 m from the base, limit 20 m")


def test_a_sensor_at_no_place_is_refused() -> None:
    reason, detail = refused(replace(SWEEP, sensor_position_m=np.array([0.0, math.nan, 0.0])))
    assert (reason, detail) == ("wrong extrinsics", "'roof' at 0, nan, 0 m, nan m from the base, limit 20 m")


@pytest.mark.parametrize("orientation", [(0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.1, 1.0), (0.0, 0.0, math.nan, 1.0)])
def test_an_orientation_that_is_no_unit_quaternion_is_refused(orientation: tuple[float, ...]) -> None:
    reason, detail = refused(replace(SWEEP, sensor_orientation=np.array(orientation)))
    assert reason == "wrong extrinsics"
    assert "1 to within 0.001 is needed" in detail


def test_a_quaternion_written_with_three_decimals_is_taken() -> None:
    within_limits(replace(SWEEP, sensor_orientation=np.array([0.0, 0.0, 0.707, 0.707])))


@pytest.mark.parametrize("offset_ns", [1_000_000_001, -1_000_000_001, -(2**31)])
def test_a_clock_that_jumps_within_a_sweep_is_refused(offset_ns: int) -> None:
    reason, detail = refused(with_offset(offset_ns))
    assert (reason, detail) == (
        "clock jumped in sweep",
        f"a point {offset_ns / 1e9:.6g} s after its sweep's stamp, limit 1 s either way",
    )


@pytest.mark.parametrize("offset_ns", [1_000_000_000, -1_000_000_000])
def test_a_point_one_second_from_the_stamp_is_taken(offset_ns: int) -> None:
    assert within_limits(with_offset(offset_ns)).offset_ns[1] == offset_ns  # type: ignore[union-attr]  # a sweep


def test_a_point_beyond_any_lidars_reach_is_refused() -> None:
    reason, detail = refused(sweep_of(3, value=-1000.5))
    assert (reason, detail) == ("point out of range", "a coordinate of 1000.5 m from the sensor, limit 1000 m")


def test_an_infinite_point_is_one_that_did_not_come_back() -> None:
    points = np.array([[1.0, 2.0, 3.0], [math.inf, 2.0, 3.0]], dtype=np.float32)
    taken = within_limits(replace(SWEEP, point_m=points))
    assert isinstance(taken, PointsScanned)
    assert np.isnan(taken.point_m).all(axis=1).tolist() == [False, True]


def test_a_sensors_name_has_a_limit() -> None:
    assert refused(replace(SWEEP, sensor="x" * 201)) == ("out of range", "sensor of 201 characters, limit 200")


def test_a_cloud_is_never_plain_and_so_always_looked_at() -> None:
    schema, payload = encode(SWEEP)
    assert not PlainPayloads().plain(schema, [payload] * 20).any()


def taken_in(*sweeps: PointsScanned) -> tuple[MemoryLog, Journal]:
    log = MemoryLog()
    journal = Journal(log, None, IngestSettings())
    events: tuple[Observed, ...] = (VehicleDescribed(vehicle="van"), *sweeps)
    for sequence, event in enumerate(events):
        schema, payload = encode(event)
        journal.take(RawMessage("t", schema, payload, EventIdentity("van", "b", sequence), STAMP_NS + sequence))
    journal.flush()
    return log, journal


def test_a_sound_sweep_is_in_the_log_exactly() -> None:
    log, _ = taken_in(SWEEP)
    row = next(log.read("veh-van", kinds=(PointsScanned,)))
    assert same_event(row.envelope.event, SWEEP)


def test_a_refused_sweep_is_counted_kept_aside_and_costs_the_others_nothing() -> None:
    log, journal = taken_in(SWEEP, sweep_of(0), SWEEP)
    assert (journal.tally.report().accepted, journal.tally.report().refused) == (3, (("empty sweep", 1),))
    kept = next(log.read("refused")).envelope.event
    assert isinstance(kept, EventRefused)
    assert (kept.schema_name, kept.reason) == (schema_name(PointsScanned), "empty sweep")
