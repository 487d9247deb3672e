"""A drive excluded and an anchor retracted while optimisation is at work: the next whole version never knew them."""

from contextlib import closing
from dataclasses import replace

import numpy as np

from solved_worlds.examples import Lap, world
from solved_worlds.logged import append_world
from trigpoint.events.mapped import MapSolved
from trigpoint.events.solved import SolvedMap
from trigpoint.logs.memory_log import MemoryLog
from trigpoint.logs.readings import logged_maps
from trigpoint_ingest.corrections import Attribution, exclude_drives, retract_anchor
from trigpoint_optimisation.app import STREAM, build
from trigpoint_optimisation.live import LiveOptimisation
from trigpoint_optimisation.settings import LiveSettings, OdometrySettings, SolveSettings
from trigpoint_optimisation.whole_solve import SolverInPlace

AT_ONCE = LiveSettings(version_interval_s=0.0, settle_s=0.0, correction_delay_s=0.0)
SETTINGS = SolveSettings(odometry=OdometrySettings(keyframe_m=4.0), live=AT_ONCE)  # coarse: quick
BY = Attribution(author="operator", reason="in a test", stamp_ns=0)


def whole_versions(log: MemoryLog) -> int:
    heads = [row.envelope.event for row in log.read(STREAM, kinds=(MapSolved,))]
    return sum(not head.base_version for head in heads if isinstance(head, MapSolved) and head.method != "incremental")


def next_whole(service: LiveOptimisation, log: MemoryLog) -> SolvedMap:
    before = whole_versions(log)
    while whole_versions(log) == before:
        service.step()
    return logged_maps(log)[-1]


def landmark_positions(found: SolvedMap) -> list[list[float]]:
    return sorted(np.round(row.position_m, 6).tolist() for row in found.landmarks)


def test_the_next_whole_version_is_as_if_they_had_never_been() -> None:
    everything, log, never = (
        world(Lap(duration_s=60.0), Lap(vehicle="van", seed=2, duration_s=40.0)),
        MemoryLog(),
        MemoryLog(),
    )
    append_world(log, everything)
    with closing(LiveOptimisation(log, SolverInPlace(log, SETTINGS), settings=SETTINGS)) as service:
        first = next_whole(service, log)
        exclude_drives(log, "van", boot_id=None, by=BY)
        retract_anchor(log, everything.anchors[0].anchor, image=everything.anchors[0].image, by=BY)
        second = next_whole(service, log)
    append_world(never, replace(everything, drives=everything.drives[:1], anchors=everything.anchors[1:]))
    build(never, SETTINGS)
    assert landmark_positions(second) == landmark_positions(logged_maps(never)[-1])
    assert [{path.vehicle for path in one.trajectories} for one in (first, second)] == [{"car", "van"}, {"car"}]
    assert second.head.anchor_count < first.head.anchor_count
