"""What the tiles service may be told."""

from dataclasses import dataclass
from typing import Annotated

from pydantic import Field

from trigpoint.configuration.limits import Positive

GIBIBYTE = 1024**3


@dataclass(frozen=True, slots=True, kw_only=True)
class TilesSettings:
    """How points become rasters.

    Pixels are `resolution_m` of ground a side (of web tiles: the first zoom as fine). Points nearer to their sensor
    than `range_least_m` or farther than `range_most_m` are left out. What is gathered and not yet on disk takes at most
    `memory_bytes`. With `deskew` each point is placed by the pose at its own time, without it by that at its sweep's
    stamp, as if the vehicle had stood still meanwhile. Overviews for the web begin `zooms` below the finest zoom.
    `attribution` goes into every file.
    """

    resolution_m: Annotated[float, Field(ge=0.01, le=100.0)] = 0.1
    range_least_m: Positive = 1.5
    range_most_m: Annotated[float, Field(gt=0.0, le=300.0)] = 60.0
    memory_bytes: Annotated[int, Field(ge=64 * 1024**2)] = GIBIBYTE
    deskew: bool = True
    zooms: Annotated[int, Field(ge=0, le=24)] = 8
    attribution: str = ""
