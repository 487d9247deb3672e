"""`trigpoint ortho`: the lidar points of all drives as rasters, and where aerial images lie beside them."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import click

from trigpoint.errors import InputError
from trigpoint.logs.mcap_log import McapLog
from trigpoint.logs.ports import RecallingLog
from trigpoint.workers import workers
from trigpoint_cli.anchors import anchor_values
from trigpoint_cli.corrections import attributed
from trigpoint_cli.data_dir import DataDirectory, beside_data_option, cluster_option, data_option
from trigpoint_cli.output import Answer, JsonObject, Screen, answering, counted
from trigpoint_ingest.core.anchors import IMAGE_SIGMA_M, SIGMA_LARGEST_M, AnchorRow
from trigpoint_ingest.measured_anchors import replace_measured
from trigpoint_tiles.anchoring import anchors_by_image
from trigpoint_tiles.app import FORMATS, Rendered, RenderedGrid, render_ortho
from trigpoint_tiles.check_layer_files import write_check_layer
from trigpoint_tiles.core.image_anchors import ImageAnchor
from trigpoint_tiles.core.image_tiles import ImageRegistration, TileRegistration
from trigpoint_tiles.core.registration import REACH_M, REACH_MOST_M
from trigpoint_tiles.hands import Hands
from trigpoint_tiles.image_registration import register_image
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
@click.option(
    "--deskew/--no-deskew", default=DEFAULTS.deskew, show_default=True, help="Place points by the pose at their time."
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


def _registration_options(function: Callable[..., Any]) -> Callable[..., Any]:
    """A command that gets `ortho`, `image` and `reach_m`."""
    for option in (
        click.option(
            "--reach-m",
            type=click.FloatRange(0.5, REACH_MOST_M),
            default=REACH_M,
            show_default=True,
            metavar="M",
            help="How far the image may be off.",
        ),
        click.option(
            "--image",
            required=True,
            metavar="PATH",
            type=click.Path(path_type=Path),
            help="A georeferenced aerial image, or a folder of web tiles {z}/{x}/{y}.",
        ),
        click.option(
            "--ortho", required=True, metavar="FILE", type=FILE, help="ortho.tif of `trigpoint ortho render`."
        ),
    ):
        function = option(function)
    return function


@command.command("register")
@_registration_options
@click.option(
    "--out", metavar="FILE", type=FILE, help="The tiles' shifts for GIS programs: a .gpkg styled for QGIS, or GeoJSON."
)
@beside_data_option
@answering
def register(
    ortho: Path, image: Path, *, reach_m: float, out: Path | None, data: DataDirectory | None, screen: Screen
) -> Answer:
    """Measure where an aerial image shows the ground, less where the ortho layer has it, tile by tile.

    With --data the viewer of that data directory shows the shifts, too.
    """
    named = image.stem
    if not named:
        raise InputError(f"--image {image}: it has no name of its own; call it by its folder's name")
    kept = () if data is None else (data.kept_shifts(named),)
    with screen.part_of("registering tiles") as progress:
        found = register_image(ortho, image, reach_m=reach_m, progress=progress)
    files = (*(() if out is None else (out,)), *kept)
    for path in files:
        write_check_layer(path, found, image=named)
    return _registered_answer(found, files)


def _registered_answer(found: ImageRegistration, files: Sequence[Path]) -> Answer:
    shift_m, covariance_m2 = found.joined()
    sigma_m = covariance_m2.diagonal() ** 0.5
    accepted = len(found.accepted)
    values = {
        "map_version": found.map_version,
        "pixel_m": found.pixel_m,
        "shift_m": {"east": shift_m[0], "north": shift_m[1]},
        "sigma_m": {"east": sigma_m[0], "north": sigma_m[1]},
        "tiles": {"count": len(found.tiles), "accepted": accepted, "items": list(map(_tile_values, found.tiles))},
        "files": list(map(str, files)),
    }
    wrote = (f"wrote {path}" for path in files)
    return Answer(values, (*map(_tile_line, found.tiles), _whole_line(found), *wrote))


@command.command("anchors")
@data_option
@_registration_options
@click.option("--name", metavar="ID", help="The image's name among anchors; that of its file or folder by default.")
@click.option(
    "--image-sigma-m",
    type=click.FloatRange(0.0, SIGMA_LARGEST_M),
    default=IMAGE_SIGMA_M,
    show_default=True,
    metavar="S",
    help="1-sigma per axis of the image's own georeference.",
)
@click.option("--author", metavar="NAME", help="Who says so; the user this runs as by default.")
@answering
def anchors(
    data: DataDirectory,
    *,
    name: str | None,
    image_sigma_m: float,
    author: str | None,
    screen: Screen,
    **asked: Any,
) -> Answer:
    """Tie the map to an aerial image: landmarks where tiles of the image show them become anchors.

    They take the place of those measured in the same image before; the next map version is solved with them.
    """
    known_as = asked["image"].stem if name is None else name
    if not known_as:
        raise InputError(f"--image {asked['image']}: it has no name of its own; give it one with --name")
    with screen.part_of("registering tiles") as progress:
        found = register_image(**asked, progress=progress)
    with data.opened_log() as log:
        measured = anchors_by_image(log, found)
        by = attributed(author, f"measured in {known_as} on map version {found.map_version}")
        rows = [_anchor_row(one, crs=found.crs, image_sigma_m=image_sigma_m) for one in measured]
        report = replace_measured(log, rows, image=known_as, by=by)
    values = {
        **anchor_values(report.imported),
        "image": known_as,
        "map_version": found.map_version,
        "tiles": {"count": len(found.tiles), "accepted": len(found.accepted)},
        "retracted": len(report.retracted.appended),
    }
    taken = report.imported
    line = (
        f"{known_as}: {taken.added} anchors measured ({taken.relabelled} of them anew), {taken.known} as before, "
        f"{values['retracted']} of before retracted"
    )
    return Answer(values, (line,), taken.complaints())


def _anchor_row(anchor: ImageAnchor, *, crs: str, image_sigma_m: float) -> AnchorRow:
    return AnchorRow(
        anchor=anchor.landmark,
        x=anchor.easting_m,
        y=anchor.northing_m,
        crs=crs,
        sigma_m=anchor.sigma_m,
        image_sigma_m=image_sigma_m,
        kind=anchor.kind,
    )


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


def _whole_line(found: ImageRegistration) -> str:
    accepted, count = len(found.accepted), counted(len(found.tiles), "tile")
    if not accepted:
        return f"none of {count} tells where the image lies"
    (east_m, north_m), _ = found.joined()
    return (
        f"{accepted} of {count}: the image shows the ground east {east_m:+.3f} m, north {north_m:+.3f} m of the layer"
    )
