"""The ortho layer: IGN's airborne points on their orthophoto, and points to raster beside datashader."""

from collections.abc import Callable
from functools import cache, partial
from math import hypot
from pathlib import Path

from airborne_points.ign import airborne_layer
from figures.figure import Bounds, Figure, Measurement, at_least, at_most
from figures.workbench import Workbench
from raster_peers.datashader_race import OWN, WEB, Race, race
from trigpoint_tiles.core.grid import RasterGrid

IGN, LAYER, RESOLUTION_M = "ign_lidar_hd", "ign.tif", 0.2
MILLION = 1e6


@cache
def raced(grid: RasterGrid) -> Race:
    """One race a grid in a run."""
    return race(grid)


def of_race(bench: Workbench, *, grid: RasterGrid, value: Callable[[Race], float]) -> Measurement:
    """A number of a race."""
    return Measurement(value=value(raced(grid)), command=f"raster_peers.datashader_race.race({grid.crs})")


def of_ign(bench: Workbench, *, value: Callable[[Callable[[str], float]], float]) -> Measurement:
    """A number of the IGN layer's registration to its orthophoto."""
    folder, layer = Path(bench.drive(IGN)), Path(bench.path(LAYER))
    if not layer.exists():
        airborne_layer(folder, layer, resolution_m=RESOLUTION_M)
    image = folder / "test_data_rgb.tif"
    outcome = bench.run("ortho", "register", "--ortho", str(layer), "--image", str(image), "--json")
    return Measurement(value=value(outcome.at), command=outcome.command)


def registered(name: str, unit: str, target: Bounds | None, value: Callable[[Callable[[str], float]], float]) -> Figure:
    """A figure of the registration."""
    return Figure(name=name, unit=unit, target=target, measure=partial(of_ign, value=value))


def beside(name: str, unit: str, target: Bounds | None, grid: RasterGrid, value: Callable[[Race], float]) -> Figure:
    """A figure of a race."""
    return Figure(name=name, unit=unit, target=target, measure=partial(of_race, grid=grid, value=value))


FIGURES = (
    registered(
        "IGN tile: shift of the orthophoto against the airborne points",
        "m",
        at_most(0.2),
        lambda at: hypot(at("shift_m.east"), at("shift_m.north")),
    ),
    registered("the same, east", "m", None, lambda at: at("shift_m.east")),
    registered("the same, north", "m", None, lambda at: at("shift_m.north")),
    registered("its sigma, east", "m", None, lambda at: at("sigma_m.east")),
    registered("its sigma, north", "m", None, lambda at: at("sigma_m.north")),
    registered("tiles that tell, of one", "", at_least(1.0), lambda at: at("tiles.accepted")),
    beside(
        "points to web raster, over NumPy, pyproj and datashader", "x", at_least(5.0), WEB, lambda found: found.ratio
    ),
    beside("web raster, kernel", "million points/s", None, WEB, lambda found: found.kernel / MILLION),
    beside("web raster, datashader", "million points/s", None, WEB, lambda found: found.datashader / MILLION),
    beside("points to the map's own grid, nothing to project", "x", None, OWN, lambda found: found.ratio),
    beside("the map's own grid, kernel", "million points/s", None, OWN, lambda found: found.kernel / MILLION),
    beside("the map's own grid, datashader", "million points/s", None, OWN, lambda found: found.datashader / MILLION),
)
