"""Questions about the map as people type them."""

import math
import re

from trigpoint.errors import InputError
from trigpoint.landmarks.queries import DegreeBox, Disc, Nearest, TimeSpan

BBOX_FORM = "lon_min,lat_min,lon_max,lat_max"
POSITION_FORM = "LAT,LON"
SPAN_FORM = "FIRST_NS,LAST_NS"
WHOLE_NUMBER = re.compile(r"-?[0-9]{1,19}")


def bbox_of(text: str) -> DegreeBox:
    """The box of "lon_min,lat_min,lon_max,lat_max" in degrees. Raises InputError."""
    lon_min_deg, lat_min_deg, lon_max_deg, lat_max_deg = _numbers(text, 4, BBOX_FORM)
    return DegreeBox(lon_min_deg=lon_min_deg, lat_min_deg=lat_min_deg, lon_max_deg=lon_max_deg, lat_max_deg=lat_max_deg)


def near_of(text: str, *, radius_m: float) -> Disc:
    """The disc around "LAT,LON" in degrees. Raises InputError."""
    lat_deg, lon_deg = _numbers(text, 2, POSITION_FORM)
    return Disc(lat_deg=lat_deg, lon_deg=lon_deg, radius_m=radius_m)


def nearest_of(text: str, *, count: int) -> Nearest:
    """The nearest to "LAT,LON" in degrees. Raises InputError."""
    lat_deg, lon_deg = _numbers(text, 2, POSITION_FORM)
    return Nearest(lat_deg=lat_deg, lon_deg=lon_deg, count=count)


def span_of(text: str) -> TimeSpan:
    """The span of "first,last" in nanoseconds since 1970. Raises InputError."""
    first, _, last = text.partition(",")
    if not (WHOLE_NUMBER.fullmatch(first) and WHOLE_NUMBER.fullmatch(last)):
        raise InputError(f"{text!r} is not {SPAN_FORM}, two whole numbers of nanoseconds since 1970")
    return TimeSpan(first_ns=int(first), last_ns=int(last))


def _numbers(text: str, count: int, form: str) -> list[float]:
    parts = text.split(",")
    if len(parts) != count:
        raise InputError(f"{text!r} has {len(parts)} numbers: {form} has {count}")
    return [_number(part, text, form) for part in parts]


def _number(part: str, text: str, form: str) -> float:
    try:
        value = float(part)
    except ValueError as error:
        raise InputError(f"{part!r} in {text!r} is not a number: {form} is needed") from error
    if not math.isfinite(value):
        raise InputError(f"{part!r} in {text!r} is not finite: {form} is needed")
    return value
