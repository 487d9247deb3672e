"""What is set of the HTTP service."""

from dataclasses import dataclass
from ipaddress import ip_address
from pathlib import Path
from typing import Annotated, Literal
from urllib.parse import urlsplit

from pydantic import Field

from trigpoint.configuration.limits import Count, Name, Port, Positive, Seconds
from trigpoint.errors import InputError

MEBIBYTE = 1024 * 1024


Longitude = Annotated[float, Field(ge=-180.0, le=180.0)]
Latitude = Annotated[float, Field(ge=-90.0, le=90.0)]
Zoom = Annotated[int, Field(ge=0, le=24)]


@dataclass(frozen=True, slots=True, kw_only=True)
class RasterSettings:
    """A picture of the ground in a folder of XYZ tiles in Web Mercator, `{z}/{x}/{y}.{ending}`.

    `bounds` are west, south, east and north in degrees; `images` are those aerial images, by the name labels give
    them, whose ground this is.
    """

    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9_-]{1,60}$")]
    folder: Path
    bounds: tuple[Longitude, Latitude, Longitude, Latitude]
    title: str = ""
    kind: Literal["ortho", "aerial"] = "aerial"
    attribution: str = ""
    minzoom: Zoom = 0
    maxzoom: Zoom = 22
    ending: Literal["png", "jpg", "webp"] = "png"
    images: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        west, south, east, north = self.bounds
        if west >= east or south >= north or self.minzoom > self.maxzoom:
            raise InputError(
                f"raster {self.name}: bounds {west:g}, {south:g}, {east:g}, {north:g} and zoom {self.minzoom} to "
                f"{self.maxzoom}: west, south, east, north and from the least zoom to the most are needed"
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class WebSettings:
    """Where the map is served over HTTP, to whom, and how much of it.

    `public_url` is what links begin with, where a proxy stands in front; without one it is what a client called.
    `token_file` holds who may do what (`trigpoint tokens`). Without one only this machine is served, nothing can be
    written, and nobody needs a token; with `open_reading` nobody needs one to read. `origins` are the web pages'
    origins that may call from a browser. A token, and an address without one, may ask `rate_hz` times a second and
    `burst` times at once. A body has at most `body_limit_bytes`, and has to arrive within `body_timeout_s`. Tiles are
    kept in `tile_cache_mib` of memory. The database is looked at every `look_s`, and at once
    when the bus tells of a new version, if it is to be listened to. `listeners` may follow the versions at once.
    `rasters` are pictures of the ground to show below the map.
    """

    host: Name = "127.0.0.1"
    port: Port = 8080
    public_url: str = ""
    token_file: Path | None = None
    open_reading: bool = False
    origins: tuple[str, ...] = ()
    rate_hz: Positive = 500.0
    burst: Count = 2000
    body_limit_bytes: Annotated[int, Field(ge=256, le=MEBIBYTE)] = 65_536
    body_timeout_s: Seconds = 10.0
    parallel_limit: Count = 512
    connections: Annotated[int, Field(ge=1, le=64)] = 4
    tile_cache_mib: Count = 64
    look_s: Seconds = 1.0
    listen_to_bus: bool = True
    listeners: Count = 64
    rasters: tuple[RasterSettings, ...] = ()

    def __post_init__(self) -> None:
        names = [one.name for one in self.rasters]
        if len(names) != len(set(names)):
            raise InputError(f"rasters {', '.join(names)}: each needs a name of its own")
        for name, url in (("public_url", self.public_url), *(("origins", origin) for origin in self.origins)):
            if url and (urlsplit(url).scheme not in ("http", "https") or not urlsplit(url).netloc):
                raise InputError(f"{name} {url!r}: begins with http:// or https://, and a host")
        if self.token_file is None and not self.open_reading and not is_loopback(self.host):
            raise InputError(f"host {self.host!r} is reached from elsewhere: token_file or open_reading is needed")


def is_loopback(host: str) -> bool:
    """Whether only this machine reaches a host's name or address."""
    try:
        return host == "localhost" or ip_address(host).is_loopback
    except ValueError:
        return False
