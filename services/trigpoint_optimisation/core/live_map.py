"""The map as it stands between two whole solves: it takes drives leg by leg and gives landmarks and places."""

from collections import deque
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from trigpoint.events.mapped import LandmarkSolved
from trigpoint.events.observed import VehicleDescribed
from trigpoint.geodesy.poses import transform_points
from trigpoint.geodesy.projection import MapFrame
from trigpoint_optimisation.core.constellation import Constellation
from trigpoint_optimisation.core.graph import MIN_RANGE_M
from trigpoint_optimisation.core.incremental import IncrementalGraph
from trigpoint_optimisation.core.live_association import Candidate, answer, candidate, chi_square
from trigpoint_optimisation.core.live_fixes import hang_fix, local_fix
from trigpoint_optimisation.core.live_landmarks import LiveLandmark, LiveLandmarks, detected_name
from trigpoint_optimisation.core.live_leg import HungFix, Leg
from trigpoint_optimisation.core.live_placing import Placed, map_from_odom, placed_by_fixes
from trigpoint_optimisation.core.live_sights import hang_sight
from trigpoint_optimisation.core.live_state import DriveInMap, DriveName, DrivePlace, into_frame
from trigpoint_optimisation.core.live_tracks import Seen, Sight, Track, sight_of, usable
from trigpoint_optimisation.core.merging import joint_shift_pairs
from trigpoint_optimisation.settings import SolveSettings

Floats = NDArray[np.float64]

WAITING_M = 400.0  # of path that a drive without a place keeps: older things are not seen again
OPEN_M = 150.0  # of path after which a track that nothing decided is let go
VOTED_EVERY_M = 10.0  # of path
REACH_M = 12.0  # around where a track lies, within which landmarks may be its own
CANDIDATES_MOST = 4  # of them, the nearest
LOOKS_MOST = 2  # legs of which an update takes in what was seen: hundreds wait once a drive has found its place
TOLD_MOST = 60  # landmarks in a version: their covariances are what it takes longest for
RETRIED_EVERY = 5  # keyframes: a track that nothing decides
FOLLOWED_SIGMA_M = 0.15  # between a vehicle and a landmark it has in sight
DISAGREEMENT = 25.0  # chi-square of a sighting that is not of its landmark
UNJUDGED_MOST = 1000  # fixes that wait for their verdict, or were rejected
STRIKES = 3  # such sightings in a row, and the track is no more of it
FIX_SIGMA_M = 3.0  # of a fix, slow and white part together, where a drive is placed by them
NIS_KEPT, NIS_ENOUGH = 300, 100
NIS_LIMIT = 2.0 * 2.0  # mean of chi-square, 2 degrees of freedom, twice
CONFLICTS_LIMIT = 10  # tracks that had to leave their landmark


class LiveMap:
    """A map that grows by legs; `base` are the landmarks of the version it starts from."""

    def __init__(self, frame: MapFrame, settings: SolveSettings, *, base: Sequence[LandmarkSolved] = ()) -> None:
        self._known = LiveLandmarks(base)
        self._frame, self._settings = frame, settings
        self._graph = IncrementalGraph()
        covariance = np.array([event.covariance_m2 for event in base]).reshape(-1, 2, 2)
        self._graph.add_solved_landmarks(self._known.point_m, covariance)
        self._graph.update()
        self._drives: dict[DriveName, DriveInMap] = {}
        self._touched: set[int] = set()
        self._nis: deque[float] = deque(maxlen=NIS_KEPT)
        self._conflicts = 0

    @property
    def landmarks(self) -> Sequence[LiveLandmark]:
        """What is known of each landmark besides where it is."""
        return self._known.all

    @property
    def pose_count(self) -> int:
        """How many keyframes are in the graph."""
        return self._graph.pose_count

    @property
    def doubt(self) -> str:
        """Why the map should be solved as a whole, empty where nothing contradicts it."""
        if len(self._nis) >= NIS_ENOUGH and float(np.mean(self._nis)) > NIS_LIMIT:
            return f"sightings are off by a mean chi-square of {np.mean(self._nis):.1f}: {NIS_LIMIT:g} is the limit"
        if self._conflicts >= CONFLICTS_LIMIT:
            return f"{self._conflicts} tracks had to leave their landmark: {CONFLICTS_LIMIT} is the limit"
        return ""

    def begin(self, described: VehicleDescribed, boot_id: str, *, placed: Placed | None = None) -> None:
        """A drive from here on, at a place known from before if there is one."""
        drive = DriveInMap(index=len(self._drives), described=described, boot_id=boot_id)
        self._drives[described.vehicle, boot_id] = drive
        if placed is not None:
            self._start(drive, placed)

    def knows(self, name: DriveName) -> bool:
        """Whether the drive has begun."""
        return name in self._drives

    def is_placed(self, name: DriveName) -> bool:
        """Whether the drive has a place."""
        return name in self._drives and self._drives[name].placed

    def judged(self, name: DriveName, fix_sequence: int) -> None:
        """The filter accepted a fix: from now on it holds."""
        drive = self._drives.get(name)
        if drive is not None and fix_sequence in drive.hung:
            self._take_fix(drive, *drive.hung.pop(fix_sequence))

    def take(self, name: DriveName, leg: Leg) -> list[DrivePlace]:
        """One leg of a drive; where it is now, if it has a place. What it saw on the way is looked at later where much
        of that waits."""
        drive = self._drives[name]
        self._extend(drive, leg)
        self._look_on(drive)
        return [self.place(name)] if drive.placed else []

    def look_again(self, name: DriveName, leg: Leg) -> bool:
        """Whether a leg of which more was seen since it was taken is in the graph, or may still come there: then that
        is looked at too."""
        drive = self._drives.get(name)
        if drive is None:
            return False
        if not drive.placed:
            kept = bool(drive.waiting) and leg.keyframe >= drive.waiting[0].keyframe
            drive.pending |= leg.tracks if kept else {}
            return kept
        if leg.keyframe < drive.first_keyframe:
            return False
        if all(each.keyframe != leg.keyframe for each in drive.unseen):
            drive.unseen.append(leg)
        return True

    @property
    def told_count(self) -> int:
        """How many landmarks were told of."""
        return self._known.told_count

    def catch_up(self) -> bool:
        """A little of what waits to be looked at; whether there was any."""
        behind = next((drive for drive in self._drives.values() if drive.unseen), None)
        if behind is not None:
            self._look_on(behind)
        return behind is not None

    def _look_on(self, drive: DriveInMap) -> None:
        """The oldest legs that were not looked at, so few that an update stays short."""
        for _ in range(min(LOOKS_MOST, len(drive.unseen))):
            leg = drive.unseen.popleft()
            at_m = self._graph.pose(drive.index, leg.keyframe)[:2]
            self._refresh(self._known.within(at_m, self._settings.detections.max_range_m + REACH_M))
            self._look(drive, leg)
            self._graph.update()

    def place(self, name: DriveName) -> DrivePlace:
        """Where a placed drive is."""
        drive = self._drives[name]
        leg = drive.newest
        assert leg is not None, "a placed drive has a leg"
        T_map_base = self._graph.pose(drive.index, leg.keyframe + 1)
        return DrivePlace(
            vehicle=name[0],
            boot_id=name[1],
            stamp_ns=leg.end_ns,
            T_map_base=T_map_base,
            T_map_odom=map_from_odom(T_map_base, leg.T_odom_end),
            covariance=self._graph.pose_covariance(drive.index, leg.keyframe + 1),
        )

    def changed_landmarks(self, *, share: float) -> list[LandmarkSolved]:
        """The landmarks that are new or moved by more than `share` of their sigma since they were told of last, or were
        seen again and are known clearly better; of many those that moved most. From now on they are told of. One that
        was not seen again keeps the covariance it was told with: it is known no worse."""
        known = self._known
        self._refresh(range(len(self.landmarks)))
        moved = known.moved_sigmas()
        due = [n for n in np.argsort(-moved, kind="stable")[:TOLD_MOST].tolist() if moved[n] > share]
        seen = sorted(self._touched.difference(due))[: TOLD_MOST - len(due)]
        asked = sorted([n for n in due if n in self._touched or np.isinf(moved[n])] + seen)
        covariance = dict(zip(asked, self._graph.landmark_covariances(asked), strict=True))
        surer = [n for n in seen if known.is_surer(n, covariance[n])]
        self._touched.difference_update(due, seen)
        return [known.told(n, covariance.get(n)) for n in sorted(due + surer)]

    def _refresh(self, numbers: Iterable[int]) -> None:
        for number in map(int, numbers):
            self._known.point_m[number] = self._graph.point(number)

    def _extend(self, drive: DriveInMap, leg: Leg) -> None:
        for fix in leg.fixes:
            drive.hung[fix.sequence] = leg.keyframe, fix
        while len(drive.hung) > UNJUDGED_MOST:
            del drive.hung[next(iter(drive.hung))]
        if drive.placed:
            self._move(drive, leg)
            return
        drive.waiting.append(leg)
        drive.waiting = [each for each in drive.waiting if each.path_m > leg.path_m - WAITING_M]
        drive.pending |= leg.tracks
        oldest = drive.waiting[0].keyframe
        drive.pending = {n: track for n, track in drive.pending.items() if track.last_keyframe >= oldest}
        placed = self._place_of(drive)
        if placed is not None:
            self._start(drive, placed)

    def _place_of(self, drive: DriveInMap) -> Placed | None:
        fixes = [fix for fix in drive.fixes.values() if fix.keyframe >= drive.waiting[0].keyframe]
        placed = placed_by_fixes(drive.waiting, fixes, sigma_m=FIX_SIGMA_M)
        if placed is not None or fixes:
            return placed
        least = self._settings.detections.min_detections
        tracks = [track for track in drive.pending.values() if track.count >= least]
        known = Constellation(point_m=self._known.point_m, kind=self._known.kind)
        return drive.placing.take(drive.waiting, tracks, known)

    def _start(self, drive: DriveInMap, placed: Placed) -> None:
        """The drive in the graph from a keyframe on, with what waited since."""
        drive.placed, drive.first_keyframe = True, placed.keyframe
        self._graph.add_start(drive.index, placed.keyframe, placed.pose, placed.covariance)
        legs = [leg for leg in drive.waiting if leg.keyframe >= placed.keyframe]
        drive.waiting = []
        for leg in legs:
            self._move(drive, leg)
        for fix in [fix for fix in drive.fixes.values() if fix.keyframe >= placed.keyframe]:
            hang_fix(self._graph, drive, fix, legs[fix.keyframe - placed.keyframe].start_ns)
        drive.fixes.clear()
        drive.pending.clear()
        self._graph.update()

    def _move(self, drive: DriveInMap, leg: Leg) -> None:
        drive.newest = leg
        self._graph.add_motion(drive.index, leg.keyframe, leg.delta, leg.covariance)
        drive.unseen.append(leg)

    def _take_fix(self, drive: DriveInMap, keyframe: int, fix: HungFix) -> None:
        local = local_fix(fix, drive.described, self._frame, keyframe=keyframe)
        if local is None:
            return
        if not drive.placed:
            drive.fixes[fix.sequence] = local
        elif keyframe >= drive.first_keyframe and drive.newest is not None and keyframe <= drive.newest.keyframe:
            hang_fix(self._graph, drive, local, fix.stamp_ns)

    def _look(self, drive: DriveInMap, leg: Leg) -> None:
        """What was seen from a keyframe goes into the graph, as far as it is known what it is."""
        tracks = [leg.tracks[number] for number in sorted(leg.tracks)]
        if not tracks:
            return
        known = [track for track in tracks if track.number in drive.of]
        self._check(drive, leg, known)
        for track in known:
            if track.number in drive.of:
                self._sight(drive, leg, track)
        least = self._settings.detections.min_detections
        fresh = [
            track for track in tracks if track.number not in drive.of and (track.count >= least or track.signature)
        ]
        self._associate(drive, leg, fresh)
        self._vote(drive, leg)

    def _check(self, drive: DriveInMap, leg: Leg, known: Sequence[Track]) -> None:
        """Tracks whose sightings contradict their landmark again and again leave it; single ones are left out."""
        seen = {
            track.number: self._sight_of(here)
            for track in known
            if (here := [each for each in track.fresh(leg.keyframe) if each.keyframe == leg.keyframe])
        }
        if not seen:
            return
        pose = self._graph.pose(drive.index, leg.keyframe)
        for track in [track for track in known if track.number in seen]:
            sight = seen[track.number]
            expected = into_frame(pose, self._graph.point(drive.of[track.number]))
            off = chi_square(sight.point_m - expected, sight.whole_covariance + FOLLOWED_SIGMA_M**2 * np.eye(2))
            self._nis.append(min(off, DISAGREEMENT))
            if off <= DISAGREEMENT:
                drive.strikes.pop(track.number, None)
                continue
            track.use(leg.keyframe)
            drive.strikes[track.number] = drive.strikes.get(track.number, 0) + 1
            if drive.strikes[track.number] >= STRIKES:
                del drive.of[track.number], drive.strikes[track.number]
                drive.own.pop(track.number, None)
                self._conflicts += 1

    def _sight_of(self, seen: Sequence[Seen]) -> Sight:
        offset_m = self._settings.calibration.range_offset_m
        return sight_of(seen, shared_share=self._settings.detections.shared_share, offset_m=offset_m)

    def _sight(self, drive: DriveInMap, leg: Leg, track: Track) -> None:
        """Everything seen of a track up to a keyframe becomes sightings of its landmark, one a keyframe."""
        number, fresh, taken = drive.of[track.number], track.use(leg.keyframe), []
        for keyframe in sorted({each.keyframe for each in fresh if each.keyframe >= drive.first_keyframe}):
            seen = [each for each in fresh if each.keyframe == keyframe]
            sight = self._sight_of(seen)
            if np.hypot(*sight.point_m) <= MIN_RANGE_M:
                continue
            taken += seen
            common_m = self._settings.detections.common_sigma_m
            hang_sight(self._graph, drive, keyframe, track.number, sight=sight, common_sigma_m=common_m)
        if taken:
            vehicle = drive.described.vehicle
            self.landmarks[number].take(track, taken, vehicle=vehicle, boot_id=drive.boot_id)
            self._touched.add(number)

    def _associate(self, drive: DriveInMap, leg: Leg, fresh: Sequence[Track]) -> None:
        by_number = {track.number: track for track in fresh}
        fresh = [track for track in fresh if track.number not in drive.pending or not leg.keyframe % RETRIED_EVERY]
        fresh = [track for track in fresh if usable(track, drive.first_keyframe, leg.keyframe)]
        found = answer(self._candidates(drive, leg.keyframe, fresh))
        for number, landmark in found.of.items():
            self._settle(drive, leg, by_number[number], landmark)
        for number in found.new:
            self._settle(drive, leg, by_number[number], self._new_landmark(drive, leg, by_number[number]))
        for number in found.open:
            drive.pending.setdefault(number, by_number[number])
            drive.pending_since_m.setdefault(number, leg.path_m)

    def _settle(self, drive: DriveInMap, leg: Leg, track: Track, landmark: int) -> None:
        drive.of[track.number] = landmark
        drive.pending.pop(track.number, None)
        drive.pending_since_m.pop(track.number, None)
        self._sight(drive, leg, track)

    def _candidates(self, drive: DriveInMap, keyframe: int, tracks: Sequence[Track]) -> dict[int, list[Candidate]]:
        """The landmarks that each of these tracks, all seen from this keyframe, may be of, by track number. What is
        expected is asked for all of them at once: that takes as long as for one."""
        pose, seen, near = self._graph.pose(drive.index, keyframe), {}, {}
        for track in tracks:
            seen[track.number] = sight = self._sight_of([each for each in track.seen if each.keyframe == keyframe])
            near[track.number] = self._near(drive, track, transform_points(pose, sight.point_m))
        asked = sorted({landmark for found in near.values() for landmark in found})
        expected, covariance = self._graph.seen_from(drive.index, keyframe, asked)
        row = {landmark: number for number, landmark in enumerate(asked)}
        found = {
            number: [
                candidate(
                    n,
                    seen[number].point_m,
                    expected[row[n]],
                    noise=seen[number].whole_covariance,
                    expectation=covariance[row[n]],
                )
                for n in landmarks
            ]
            for number, landmarks in near.items()
        }
        return found | {track.number: self._named(track) for track in tracks if track.signature}

    def _named(self, track: Track) -> list[Candidate]:
        """The landmarks of a track's signature."""
        found = self._known.signed(track.signature)
        return [Candidate(landmark=n, chi_square=0.0, distance_m=0.0, sigma_m=0.0) for n in found]

    def _near(self, drive: DriveInMap, track: Track, at_m: Floats) -> list[int]:
        """The nearest landmarks of a nameless track's kind that it does not stand beside."""
        if track.signature:
            return []
        beside = {drive.of[other] for other in track.apart if other in drive.of}
        near = [n for n in self._known.within(at_m, REACH_M).tolist() if n not in beside]
        return [n for n in near if self.landmarks[n].kind == track.kind][:CANDIDATES_MOST]

    def _new_landmark(self, drive: DriveInMap, leg: Leg, track: Track) -> int:
        sequence, row = track.first
        name = detected_name(drive.described.vehicle, drive.boot_id, sequence=sequence, row=row)
        last = usable(track, drive.first_keyframe, leg.keyframe)[-1]
        point_m = transform_points(self._graph.pose(drive.index, last.keyframe), last.point_m)
        number = self._known.add(name, point_m, kind=track.kind, signature=track.signature)
        self._graph.add_landmark(number, point_m)
        return number

    def _vote(self, drive: DriveInMap, leg: Leg) -> None:
        """Tracks that one landmark alone could not decide, decided by one joint shift of them all, or let go."""
        for number in [n for n, since in drive.pending_since_m.items() if leg.path_m > since + OPEN_M]:
            drive.pending.pop(number, None)
            del drive.pending_since_m[number]
        detections = self._settings.detections
        if len(drive.pending) < detections.min_votes or leg.path_m < drive.voted_m + VOTED_EVERY_M:
            return
        drive.voted_m = leg.path_m
        tracks = [each for each in drive.pending.values() if usable(each, drive.first_keyframe, leg.keyframe)]
        if len(tracks) < detections.min_votes:
            return
        at = np.array([self._in_map(drive, leg, track) for track in tracks])
        near = np.setdiff1d(self._known.within(at.mean(axis=0), OPEN_M), list(drive.of.values()))
        if len(near) < detections.min_votes:
            return
        self._refresh(near)
        for a, b in joint_shift_pairs(at, self._known.point_m[near], settings=detections):
            landmark = int(near[b])
            if self.landmarks[landmark].kind == tracks[a].kind:
                self._settle(drive, leg, tracks[a], landmark)

    def _in_map(self, drive: DriveInMap, leg: Leg, track: Track) -> Floats:
        point: Floats = np.mean(
            [
                transform_points(self._graph.pose(drive.index, each.keyframe), each.point_m)
                for each in usable(track, drive.first_keyframe, leg.keyframe)
            ],
            axis=0,
        )
        return point
