"""One drive followed from its events as they arrive, put back into order of time first."""

import heapq
import math

from trigpoint.errors import FrameRefused
from trigpoint.events.envelope import Envelope
from trigpoint.events.estimated import Estimated
from trigpoint.events.observed import (
    GnssFixReceived,
    ImuMeasured,
    Observed,
    VehicleDescribed,
    WheelPairMeasured,
    WheelSpeedMeasured,
)
from trigpoint.geodesy.positions import MapPosition, Wgs84Position
from trigpoint.geodesy.projection import MapFrame, map_from_wgs84
from trigpoint_filtering.core.following import Track, started_track
from trigpoint_filtering.core.online import after_fix, after_imu, after_wheel
from trigpoint_filtering.core.publication import Published, output_boot_id, published
from trigpoint_filtering.settings import FilterSettings

REORDER_NS = 500_000_000  # an event may arrive this much behind a later one and still be taken in order
RANKS: dict[type, int] = {WheelSpeedMeasured: 0, WheelPairMeasured: 0, ImuMeasured: 1, GnssFixReceived: 2}
NOWHERE = MapPosition(math.nan, math.nan)


class DriveFollower:
    """Follows one boot of one vehicle; what it gives out equals what `filter_drive`'s fold gives out.

    Memory is bounded by what arrives within REORDER_NS.
    """

    def __init__(self, described: VehicleDescribed, boot_id: str, frame: MapFrame, settings: FilterSettings) -> None:
        self._track = started_track(described, boot_id=boot_id, point_scale=frame.point_scale, settings=settings)
        self._frame, self._settings = frame, settings
        self._publication = Published(output_boot_id(described.vehicle, boot_id, frame, settings))
        self._waiting: list[tuple[int, int, int, Observed]] = []
        self._newest_ns = 0

    def take(self, row: Envelope[Observed]) -> list[Envelope[Estimated]]:
        """The estimates that can be given out now that one more event is here."""
        rank = RANKS.get(type(row.event))
        if rank is None:
            return []
        heapq.heappush(self._waiting, (row.stamp_ns, rank, row.identity.sequence, row.event))
        self._newest_ns = max(self._newest_ns, row.stamp_ns)
        return self._released(self._newest_ns - REORDER_NS)

    def finish(self) -> list[Envelope[Estimated]]:
        """The estimates from everything that still waited."""
        return self._released(self._newest_ns)

    def _released(self, until_ns: int) -> list[Envelope[Estimated]]:
        told: list[Envelope[Estimated]] = []
        while self._waiting and self._waiting[0][0] <= until_ns:
            stamp_ns, _, sequence, event = heapq.heappop(self._waiting)
            self._track = _after(self._track, event, stamp_ns, sequence, self._frame)
            rows, self._publication = published(self._track, self._publication, self._settings)
            told += rows
        return told


def _after(track: Track, event: Observed, stamp_ns: int, sequence: int, frame: MapFrame) -> Track:
    if isinstance(event, WheelSpeedMeasured):
        steering_rad, yaw_rate_radps = event.steering_rad, event.yaw_rate_radps
        return after_wheel(
            track, event.speed_mps, steering_rad=steering_rad, yaw_rate_radps=yaw_rate_radps, stamp_ns=stamp_ns
        )
    if isinstance(event, WheelPairMeasured):
        return _after_pair(track, event, stamp_ns)
    if isinstance(event, ImuMeasured):
        return after_imu(track, event.yaw_rate_radps, stamp_ns=stamp_ns)
    if isinstance(event, GnssFixReceived):
        return after_fix(track, _position(event, frame), stamp_ns=stamp_ns, sigma_m=event.sigma_m, sequence=sequence)
    return track


def _after_pair(track: Track, event: WheelPairMeasured, stamp_ns: int) -> Track:
    track_m = track.following.track_m
    speed_mps = 0.5 * (event.left_mps + event.right_mps)
    yaw_rate_radps = (event.right_mps - event.left_mps) / track_m if track_m > 0.0 else math.nan
    return after_wheel(track, speed_mps, steering_rad=math.nan, yaw_rate_radps=yaw_rate_radps, stamp_ns=stamp_ns)


def _position(event: GnssFixReceived, frame: MapFrame) -> MapPosition:
    """The fix in the map frame; nowhere if the projection does not reach it, which no gate lets pass."""
    try:
        return map_from_wgs84(Wgs84Position(event.lat_deg, event.lon_deg), frame)
    except FrameRefused:
        return NOWHERE
