"""Which frame a map gets: that of the first thing that says where on Earth it is, for good."""

from trigpoint.events.corrected import AnchorLabelled
from trigpoint.events.observed import GnssFixReceived, MapFramePinned, VehicleDescribed
from trigpoint.geodesy.positions import GridPosition, Wgs84Position
from trigpoint.geodesy.projection import MapFrame, pin_map_frame, pin_map_frame_at

BY_DESCRIPTION = "declared origin"
BY_FIX = "first fix"
BY_ANCHOR = "first anchor"


def frame_of_description(event: VehicleDescribed) -> MapFrame:
    """The map frame a description declares. Raises FrameRefused for a CRS or an origin a map cannot have."""
    origin = GridPosition(event.declared_origin_easting_m, event.declared_origin_northing_m)
    return pin_map_frame(crs=event.declared_crs, origin=origin)


def frame_pinned_by(event: object) -> MapFramePinned | None:
    """The frame an accepted event would pin: a declared origin's own, the UTM zone of a fix or an anchor; or None.

    Raises FrameRefused for a declaration or a position a map cannot have.
    """
    if isinstance(event, VehicleDescribed):
        return _pinned(frame_of_description(event), BY_DESCRIPTION) if event.declared_crs else None
    if isinstance(event, GnssFixReceived):
        return _pinned(pin_map_frame_at(Wgs84Position(event.lat_deg, event.lon_deg)), BY_FIX)
    if isinstance(event, AnchorLabelled):
        return _pinned(pin_map_frame_at(Wgs84Position(event.lat_deg, event.lon_deg)), BY_ANCHOR)
    return None


def _pinned(frame: MapFrame, declared_by: str) -> MapFramePinned:
    return MapFramePinned(
        crs=frame.crs,
        origin_easting_m=frame.origin_easting_m,
        origin_northing_m=frame.origin_northing_m,
        declared_by=declared_by,
    )
