"""A block driven round once and again: the map grows, is told of, and places a vehicle that has no receiver."""

import math
from collections.abc import Iterable, Iterator
from contextlib import closing
from functools import cache

import numpy as np
import pytest

from solved_worlds.examples import FRAME, Lap, World, world
from solved_worlds.logged import all_accepted
from trigpoint.events.codec import Event
from trigpoint.events.drives import Drive
from trigpoint.events.envelope import Envelope, EventIdentity
from trigpoint.events.mapped import LandmarkSolved, MapSolved, OdometryCorrected
from trigpoint.events.observed import (
    GnssFixReceived,
    ImuMeasured,
    LandmarkDetection,
    LandmarksDetected,
    MapFramePinned,
    WheelSpeedMeasured,
)
from trigpoint.events.solved import SolvedMap
from trigpoint.logs.memory_log import MemoryLog
from trigpoint.logs.readings import logged_maps
from trigpoint.observability.metrics import Instruments
from trigpoint_optimisation.live import BATCH, LiveOptimisation
from trigpoint_optimisation.settings import LiveSettings, SolveSettings
from trigpoint_optimisation.whole_solve import SolverInPlace, WholeSolve

NEVER_S = 1e9
EAGER = SolveSettings(live=LiveSettings(version_interval_s=0.0, settle_s=NEVER_S, solve_interval_s=NEVER_S))
FINE_NS = 1_000_000


def sweeps(drive: Drive) -> Iterator[tuple[int, Event]]:
    seen = drive.detections
    for stamp in np.unique(seen.stamp_ns).tolist():
        rows = np.nonzero(seen.stamp_ns == stamp)[0]
        yield (
            stamp,
            LandmarksDetected(
                detections=tuple(
                    LandmarkDetection(float(seen.range_m[n]), float(seen.bearing_rad[n]), seen.kind[n], "", math.nan)
                    for n in rows
                )
            ),
        )


def measured(drive: Drive) -> Iterator[tuple[int, Event]]:
    yield int(drive.wheels.stamp_ns[0]) - FINE_NS, drive.described
    for stamp, speed in zip(drive.wheels.stamp_ns.tolist(), drive.wheels.speed_mps.tolist(), strict=True):
        yield stamp, WheelSpeedMeasured(speed_mps=speed, steering_rad=math.nan, yaw_rate_radps=math.nan)
    for stamp, rate in zip(drive.imu.stamp_ns.tolist(), drive.imu.yaw_rate_radps.tolist(), strict=True):
        yield stamp, ImuMeasured(yaw_rate_radps=rate, acceleration_x_mps2=math.nan, acceleration_y_mps2=math.nan)
    yield from sweeps(drive)


def fixed(drive: Drive) -> Iterator[tuple[int, Event]]:
    fixes = drive.fixes
    for stamp, lat, lon in zip(fixes.stamp_ns.tolist(), fixes.lat_deg.tolist(), fixes.lon_deg.tolist(), strict=True):
        yield stamp, GnssFixReceived(lat_deg=lat, lon_deg=lon, height_m=math.nan, sigma_m=2.0)


def numbered(source: str, boot_id: str, events: Iterable[tuple[int, Event]]) -> list[Envelope[Event]]:
    ordered = sorted(events, key=lambda row: row[0])
    return [Envelope(EventIdentity(source, boot_id, n), stamp, event) for n, (stamp, event) in enumerate(ordered)]


def accepted(rows: list[Envelope[Event]]) -> list[Envelope[Event]]:
    """The filter's word that every fix holds."""
    fixes = [row for row in rows if isinstance(row.event, GnssFixReceived)]
    return [
        Envelope(EventIdentity("filtering", rows[0].identity.source, n), row.stamp_ns, verdict)
        for n, (row, verdict) in enumerate(zip(fixes, all_accepted(rows), strict=True))
    ]


@cache
def block() -> World:
    """One car with a receiver, and one that drives the same block without."""
    return world(Lap(vehicle="car", duration_s=100.0), Lap(vehicle="van", duration_s=60.0, begin_rad=2.0, seed=2))


def car_rows() -> list[Envelope[Event]]:
    drive = block().drives[0]
    return numbered("car", "boot", [*measured(drive), *fixed(drive)])


def pinned() -> MemoryLog:
    log = MemoryLog()
    origin = {"origin_easting_m": FRAME.origin_easting_m, "origin_northing_m": FRAME.origin_northing_m}
    event = MapFramePinned(crs=FRAME.crs, **origin, declared_by="test")
    log.append("map", [Envelope(EventIdentity("ingest", "frame", 0), 0, event)])
    return log


def followed(log: MemoryLog, settings: SolveSettings = EAGER) -> None:
    """A service that takes everything the log has, and ends."""
    service = LiveOptimisation(log, SolverInPlace(log, settings), settings=settings)
    while service.step():
        pass
    service.close()


@cache
def mapped_by_the_car() -> MemoryLog:
    log, rows = pinned(), car_rows()
    log.append("filtering", accepted(rows))
    log.append("veh-car", rows)
    followed(log)
    return log


def newest(log: MemoryLog) -> SolvedMap:
    return logged_maps(log)[-1]


def off_poles_sigmas(landmarks: Iterable[LandmarkSolved]) -> list[float]:
    """How far each landmark is from the nearest pole, by its own covariance."""
    sigmas = []
    for one in landmarks:
        off = block().pole_m - one.position_m
        nearest = off[np.hypot(*off.T).argmin()]
        sigmas.append(float(np.sqrt(nearest @ np.linalg.solve(one.covariance_m2, nearest))))
    return sigmas


def test_what_is_not_taken_in_yet_and_what_becoming_durable_takes_is_measured() -> None:
    log, rows, instruments = pinned(), car_rows(), Instruments("optimisation")
    log.append("filtering", accepted(rows))
    log.append("veh-car", rows)
    with closing(LiveOptimisation(log, SolverInPlace(log, EAGER), settings=EAGER, instruments=instruments)) as service:
        assert all([service.step(), service.step()])
    shown = instruments.registry.get_sample_value
    assert shown("trigpoint_projection_lag_events") == len(rows) - 2 * BATCH
    assert shown("trigpoint_projection_lag_seconds") != 0.0
    assert shown("trigpoint_fsync_seconds_count") != 0.0


def test_a_drive_with_fixes_becomes_a_map_within_what_fixes_hold() -> None:
    found = newest(mapped_by_the_car())
    assert len(found.landmarks) >= 36  # of 41 poles, two of them 1.5 m apart
    assert np.median(off_poles_sigmas(found.landmarks)) < 3.0  # one error, that of the fixes, is common to all


def test_every_version_names_the_one_before_and_folds_to_the_counted_landmarks() -> None:
    log = mapped_by_the_car()
    heads = [row.envelope.event for row in log.read("optimisation", kinds=(MapSolved,))]
    bases = [head.base_version for head in heads if isinstance(head, MapSolved)]
    assert bases == list(range(len(heads)))
    assert newest(log).head.landmark_count == len(newest(log).landmarks)


def test_corrections_place_the_vehicle_where_it_is() -> None:
    (*_, last) = mapped_by_the_car().read("odometry")
    event, stamp_ns = last.envelope.event, last.envelope.stamp_ns
    assert isinstance(event, OdometryCorrected)
    assert stamp_ns > car_rows()[-1].stamp_ns - 1_000_000_000
    assert np.sqrt(np.diag(event.covariance)[:2]).max() < 4.0


def test_a_restart_appends_nothing_and_numbers_go_on() -> None:
    log, rows = pinned(), car_rows()
    log.append("filtering", accepted(rows))
    log.append("veh-car", rows[: len(rows) // 2])
    followed(log)
    before = log.next_number("optimisation"), log.next_number("odometry")
    followed(log)
    assert (log.next_number("optimisation"), log.next_number("odometry")) == before
    version = newest(log).head.map_version
    log.append("veh-car", rows[len(rows) // 2 :])
    followed(log)
    stamps = [row.envelope.stamp_ns for row in log.read("odometry")]
    assert stamps == sorted(set(stamps))
    assert newest(log).head.map_version > version
    assert len(newest(log).landmarks) >= 36


def test_a_vehicle_without_a_receiver_is_placed_by_the_landmarks_others_saw() -> None:
    log = pinned()
    log.append("veh-car", car_rows())
    log.append("filtering", accepted(car_rows()))
    followed(log)
    van = numbered("van", "boot", measured(block().drives[1]))
    log.append("veh-van", van)
    followed(log)
    placed = [row for row in log.read("odometry") if isinstance(row.envelope.event, OdometryCorrected)]
    assert any(
        row.envelope.event.vehicle == "van" for row in placed if isinstance(row.envelope.event, OdometryCorrected)
    )


def test_before_a_frame_is_pinned_nothing_is_said() -> None:
    log = MemoryLog()
    log.append("veh-car", car_rows()[:100])
    followed(log)
    assert log.streams() == ("veh-car",)


def test_the_whole_map_is_solved_once_no_news_comes() -> None:
    log, rows = pinned(), car_rows()
    log.append("filtering", accepted(rows))
    log.append("veh-car", rows)
    settled = SolveSettings(live=LiveSettings(version_interval_s=0.0, settle_s=0.0))
    service = LiveOptimisation(log, SolverInPlace(log, settled), settings=settled)
    while newest_method(log) != "anchored":
        service.step()
    service.close()
    assert newest(log).head.base_version == 0
    assert newest(log).trajectories[0].vehicle == "car"


class RefusingSolver(SolverInPlace):
    """One that never finds a map."""

    def result(self) -> WholeSolve:
        self.busy = False
        return WholeSolve(inputs=(), refusal="in a test")


def test_where_no_whole_map_can_be_solved_a_full_graph_begins_anew_from_the_newest_version(
    caplog: pytest.LogCaptureFixture,
) -> None:
    log, rows = pinned(), car_rows()
    live = LiveSettings(version_interval_s=0.0, settle_s=NEVER_S, solve_interval_s=0.0, pose_limit=100)
    settings = SolveSettings(live=live)
    log.append("filtering", accepted(rows))
    log.append("veh-car", rows)
    with closing(LiveOptimisation(log, RefusingSolver(log, settings), settings=settings)) as service:
        while service.step():
            pass
    assert "the graph begins anew from the newest version" in caplog.text
    assert len(newest(log).landmarks) >= 36


class EndlessSolver(SolverInPlace):
    """One that never comes to an end."""

    def result(self) -> None:
        return None


def test_while_the_whole_map_is_being_solved_the_graph_does_not_grow_without_end() -> None:
    log, rows = pinned(), car_rows()
    live = LiveSettings(version_interval_s=0.0, settle_s=NEVER_S, solve_interval_s=0.0, pose_limit=40)
    settings, instruments = SolveSettings(live=live), Instruments("optimisation")
    log.append("filtering", accepted(rows))
    log.append("veh-car", rows)
    held: list[int] = []
    service = LiveOptimisation(log, EndlessSolver(log, settings), settings=settings, instruments=instruments)
    with closing(service):
        while service.step():
            held.append(service.pose_count)
    assert 2 * live.pose_limit < max(held) < 4 * live.pose_limit  # a look takes in a thousand events
    assert len(newest(log).landmarks) >= 36


def newest_method(log: MemoryLog) -> str:
    methods = [row.envelope.event for row in log.read("optimisation", kinds=(MapSolved,))]
    return methods[-1].method if methods and isinstance(methods[-1], MapSolved) else ""
