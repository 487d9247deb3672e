"""`trigpoint ortho`: the lidar points of all drives as rasters, and where aerial images lie beside them."""

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import click

from trigpoint.errors import InputError
from trigpoint.logs.mcap_log import McapLog
from trigpoint.logs.ports import RecallingLog
from trigpoint.workers import workers
from trigpoint_cli.data_dir import DataDirectory, cluster_option, data_option
from trigpoint_cli.output import Answer, JsonObject, Screen, answering, counted
from trigpoint_tiles.app import FORMATS, Rendered, RenderedGrid, render_ortho
from trigpoint_tiles.hands import Hands
from trigpoint_tiles.image_registration import ImageRegistration, TileRegistration, register_image
from trigpoint_tiles.settings import TilesSettings

FILE = click.Path(path_type=Path, dir_okay=False)
DEFAULTS = TilesSettings()


@click.group("ortho", help="Lidar points as rasters, and aerial images beside them.")
def command() -> None:
    """Group of what can be done with the ortho layer."""


@command.command("render")
@data_option
@click.option("--out", required=True, metavar="DIR", type=click.Path(path_type=Path, file_okay=False))
@click.option("--crs", metavar="EPSG:CODE", help="Of the COG; the map's own by default.")
@click.option(
    "--format", "formats", default=",".join(FORMATS), show_default=True, metavar="LIST", help="What to write."
)
@click.option(
    "--resolution-m", type=click.FloatRange(0.01, 100.0), default=DEFAULTS.resolution_m, show_default=True, metavar="M"
)
@click.option("--attribution", default=DEFAULTS.attribution, metavar="TEXT", help="Whom the data is from.")
@click.option(
    "--threads", type=click.IntRange(0), default=0, metavar="COUNT", help="Of this process, 1 GiB each; 0: one a core."
)
@cluster_option
@answering
def render(data: DataDirectory, out: Path, *, crs: str | None, formats: str, screen: Screen, **asked: Any) -> Answer:
    """Lay the points of all drives on the ground by the newest map version's paths.

    Into DIR come ortho.tif (COG), ortho.pmtiles, xyz/{z}/{x}/{y}.png and rasters.toml for the viewer's configuration.
    Again, only what moved by more than a pixel is rendered anew.
    """
    chosen = tuple(dict.fromkeys(formats.split(",")))
    if unknown := [name for name in chosen if name not in FORMATS]:
        raise InputError(f"--format {formats}: no {', '.join(unknown)}; there are {', '.join(FORMATS)}")
    some = workers(asked.pop("cluster"), threads=asked.pop("threads"))
    settings = TilesSettings(**asked)
    with ExitStack() as stack:
        log = stack.enter_context(data.opened_log())
        hands = Hands(
            stack.enter_context(some),
            partial(_opened, data.log.absolute()),
            laying_out=stack.enter_context(screen.part_of("laying out sweeps")),
            rendering=stack.enter_context(screen.part_of("rendering tiles")),
        )
        found = render_ortho(log, out, formats=chosen, crs=crs, settings=settings, hands=hands)
    return _render_answer(found)


@contextmanager
def _opened(folder: Path) -> Iterator[RecallingLog]:
    log = McapLog(folder)
    try:
        yield log
    finally:
        log.close()


def _render_answer(found: Rendered) -> Answer:
    grids = [_grid_values(grid) for grid in found.grids]
    values = {
        "map_version": found.map_version,
        "files": [str(path) for path in found.files],
        "grids": grids,
        "sweeps_without_path": dict(found.without_path),
    }
    lines = [f"map version {found.map_version}"]
    for grid in grids:
        points = sum(drive["points"] for drive in grid["drives"].values())
        lines.append(f"  {grid['crs']}: {counted(points, 'point')}, {grid['tiles_rendered']} of {grid['tiles']} tiles")
    lines += [f"wrote {path}" for path in found.files]
    lines += [f"{drive}: {counted(count, 'sweep')} without a path" for drive, count in found.without_path.items()]
    return Answer(values, tuple(lines))


def _grid_values(grid: RenderedGrid) -> JsonObject:
    done = grid.brought_up
    return {
        "crs": grid.crs,
        "pixel_m": grid.pixel_m,
        "zoom": grid.zoom,
        "tiles": len(done.tiles),
        "tiles_rendered": len(done.rendered),
        "tiles_gone": len(done.gone),
        "drives": {
            name: {
                "gain": done.gains.get(name),
                "sweeps": one.used,
                "sweeps_kept_from_before": one.kept_from_before,
                "sweeps_outside_path": one.outside_path,
                "points": one.points,
                "points_unusable": one.points_unusable,
                "points_out_of_range": one.points_out_of_range,
            }
            for name, one in done.counts.items()
        },
    }


@command.command("register")
@click.option("--ortho", required=True, metavar="FILE", type=FILE, help="ortho.tif of `trigpoint ortho render`.")
@click.option("--image", required=True, metavar="FILE", type=FILE, help="A georeferenced aerial image.")
@answering
def register(ortho: Path, image: Path, *, screen: Screen) -> Answer:
    """Measure where an aerial image shows the ground, less where the ortho layer has it, tile by tile."""
    found = register_image(ortho, image)
    accepted = len(found.accepted)
    sigma_m = found.covariance_m2.diagonal() ** 0.5
    values = {
        "pixel_m": found.pixel_m,
        "shift_m": {"east": found.shift_m[0], "north": found.shift_m[1]},
        "sigma_m": {"east": sigma_m[0], "north": sigma_m[1]},
        "tiles": {"count": len(found.tiles), "accepted": accepted, "items": list(map(_tile_values, found.tiles))},
    }
    lines = (*map(_tile_line, found.tiles), _whole_line(found, accepted))
    return Answer(values, lines)


def _tile_values(tile: TileRegistration) -> JsonObject:
    found = tile.registration
    east_m, north_m = found.sigma_m
    return {
        "easting_m": tile.easting_m,
        "northing_m": tile.northing_m,
        "shift_m": {"east": found.shift_m[0], "north": found.shift_m[1]},
        "sigma_m": {"east": east_m, "north": north_m},
        "lean": {"east": found.lean[0], "north": found.lean[1]},
        "confidence": found.confidence,
        "refused": found.refused or None,
    }


def _tile_line(tile: TileRegistration) -> str:
    found, place = tile.registration, f"{tile.easting_m:.1f} {tile.northing_m:.1f}"
    if found.refused:
        return f"{place}  refused: {found.refused}"
    east_m, north_m = found.sigma_m
    shift = f"east {found.shift_m[0]:+.3f} ± {east_m:.3f} m, north {found.shift_m[1]:+.3f} ± {north_m:.3f} m"
    return f"{place}  {shift}, confidence {found.confidence:.3f}"


def _whole_line(found: ImageRegistration, accepted: int) -> str:
    if not accepted:
        return f"none of {counted(len(found.tiles), 'tile')} tells where the image lies"
    shift = f"east {found.shift_m[0]:+.3f} m, north {found.shift_m[1]:+.3f} m"
    return f"{accepted} of {counted(len(found.tiles), 'tile')}: the image shows the ground {shift} of the ortho layer"
