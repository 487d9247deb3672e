"""The ortho layer of a log's newest map version as files."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import partial
from hashlib import blake2b
from pathlib import Path

from trigpoint.durable_files import replace_durably
from trigpoint.errors import InputError
from trigpoint.events.solved import SolvedMap
from trigpoint.geodesy.positions import MapPosition
from trigpoint.geodesy.projection import MapFrame, wgs84_from_map
from trigpoint.geodesy.web_tiles import WebTile
from trigpoint.logs.ports import RecallingLog
from trigpoint.logs.readings import logged_frame, logged_maps
from trigpoint.workers import Tally
from trigpoint_tiles.clouds import DriveClouds, logged_clouds
from trigpoint_tiles.core.grid import RasterGrid, Tile, TileBox, box_of, projected_grid, web_mercator_grid
from trigpoint_tiles.core.pictures import picture
from trigpoint_tiles.geotiff import COORDINATE_EPOCH, MAP_VERSION, write_cog
from trigpoint_tiles.grid_layer import BroughtUp, GridLayer
from trigpoint_tiles.hands import Hands, own_hands
from trigpoint_tiles.picture_files import PictureFolder, bounds_deg, write_pmtiles
from trigpoint_tiles.settings import TilesSettings
from trigpoint_tiles.tile_rendering import BandsFolder, together

COG, PMTILES, XYZ = "cog", "pmtiles", "xyz"
FORMATS = (COG, PMTILES, XYZ)
NAME = "ortho"
NAME_MOST = 80  # characters of a folder's name
YEAR_S = 365.2425 * 86400.0


@dataclass(frozen=True, slots=True, kw_only=True)
class RenderedGrid:
    """What one grid got: its CRS, the pixel's side in its metres, the zoom of web tiles, and what was done."""

    crs: str
    pixel_m: float
    zoom: int | None
    brought_up: BroughtUp


@dataclass(frozen=True, slots=True, kw_only=True)
class Rendered:
    """The layer's files and what they were made from; `without_path`: sweeps of drives the map version has no path of,
    by drive."""

    map_version: int
    files: tuple[Path, ...]
    grids: tuple[RenderedGrid, ...]
    without_path: Mapping[str, int]


def render_ortho(
    log: RecallingLog,
    out: Path,
    *,
    formats: tuple[str, ...] = FORMATS,
    crs: str | None = None,
    settings: TilesSettings | None = None,
    hands: Hands | None = None,
) -> Rendered:
    """The points of all drives on the newest map version's paths, as files in a folder; what has not changed since the
    last time stays as it is.

    `crs` is that of the COG, the map's own by default. `hands` do the work, by default the caller's own. Drives
    without a path are counted and left out. Raises InputError where there is no map version, no sweep with a path, or
    a file cannot be written, ServiceError where workers failed.
    """
    chosen, frame = settings or TilesSettings(), logged_frame(log)
    solved = next(reversed(logged_maps(log)), None)
    if solved is None:
        raise InputError("the log holds no map version: build one first")
    every = logged_clouds(log, solved.trajectories)
    drives = tuple(one for one in every if one.path is not None)
    without = {str(one.name): len(one.sequence) for one in every if one.path is None}
    if not drives:
        detail = f"those of {', '.join(without)} have none" if without else "the log holds no sweep"
        raise InputError(f"no sweep of a lidar has a path in map version {solved.head.map_version}: {detail}")
    job = _Job(
        log=log,
        out=out,
        frame=frame,
        drives=drives,
        tags=_tags(solved, frame, drives, chosen),
        settings=chosen,
        hands=hands or own_hands(log),
    )
    try:
        out.mkdir(parents=True, exist_ok=True)
        grids, files = _written(job, formats, crs or frame.crs)
    except OSError as error:
        raise InputError(f"{out}: cannot be written: {error}") from error
    return Rendered(map_version=solved.head.map_version, files=files, grids=grids, without_path=without)


def _written(job: "_Job", formats: tuple[str, ...], crs: str) -> tuple[tuple[RenderedGrid, ...], tuple[Path, ...]]:
    grids, files = [], []
    if COG in formats:
        grid, file = _write_cog(job, crs)
        grids.append(grid)
        files.append(file)
    if PMTILES in formats or XYZ in formats:
        grid, more = _write_pictures(job, formats=formats)
        grids.append(grid)
        files += more
    return tuple(grids), tuple(files)


def _tags(
    solved: SolvedMap, frame: MapFrame, drives: tuple[DriveClouds, ...], settings: TilesSettings
) -> dict[str, str]:
    newest_ns = max(int(one.stamp_ns.max()) for one in drives)
    epoch = datetime.fromtimestamp(newest_ns / 1e9, tz=UTC)
    begin_s = datetime(epoch.year, 1, 1, tzinfo=UTC).timestamp()
    return {
        MAP_VERSION: str(solved.head.map_version),
        "MAP_CRS": frame.crs,
        "MAP_OPERATION": frame.operation,
        COORDINATE_EPOCH: f"{epoch.year + (newest_ns / 1e9 - begin_s) / YEAR_S:.3f}",
        "DESKEWED": "YES" if settings.deskew else "NO",
        "ATTRIBUTION": settings.attribution,
        "TIFFTAG_SOFTWARE": "trigpoint",
    }


@dataclass(frozen=True, slots=True, kw_only=True)
class _Job:
    """What is rendered from what, and where to."""

    log: RecallingLog
    out: Path
    frame: MapFrame
    drives: tuple[DriveClouds, ...]
    tags: Mapping[str, str]
    settings: TilesSettings
    hands: Hands

    def layer(self, grid: RasterGrid) -> tuple[GridLayer, BroughtUp]:
        """A grid's tiles, brought up."""
        named = f"{grid.crs}-{grid.pixel_m!r}" if grid.zoom is None else f"web-{grid.zoom}"
        safe = (
            named.replace(":", "-") if len(named) < NAME_MOST else blake2b(named.encode(), digest_size=16).hexdigest()
        )
        layer = GridLayer(self.out / "work" / safe, self.frame, grid, self.settings)
        heard = Tally(sum(len(one.sequence) for one in self.drives), self.hands.laying_out)
        found = layer.bring_up(self.log, self.drives, progress=heard.more, hands=self.hands)
        return layer, found


def _write_cog(job: _Job, crs: str) -> tuple[RenderedGrid, Path]:
    grid, path = projected_grid(crs, resolution_m=job.settings.resolution_m), job.out / f"{NAME}.tif"
    layer, found = job.layer(grid)
    box = _box(found)
    write_cog(path, grid, box, layer.all_bands(found.tiles), tags=job.tags)
    return RenderedGrid(crs=grid.crs, pixel_m=grid.pixel_m, zoom=None, brought_up=found), path


def _box(found: BroughtUp) -> TileBox:
    if not found.tiles:
        raise InputError("no point fell on the ground: all are too near, too far, or outside their paths' times")
    return box_of(found.tiles)


def _write_pictures(job: _Job, *, formats: tuple[str, ...]) -> tuple[RenderedGrid, list[Path]]:
    grid = _web_grid(job)
    zoom = grid.zoom or 0
    layer, found = job.layer(grid)
    _box(found)
    pictures = PictureFolder(job.out / XYZ if XYZ in formats else job.out / "work" / XYZ)
    _write_tiles(job.hands, layer, found, pictures, zoom_least=max(0, zoom - job.settings.zooms))
    bounds = bounds_deg(WebTile(zoom, tile.column, tile.row) for tile in found.tiles)
    files = [pictures.folder] if XYZ in formats else []
    if XYZ in formats:
        files.append(job.out / "rasters.toml")
        content = viewer_configuration(job, pictures.folder, bounds, zooms=(max(0, zoom - job.settings.zooms), zoom))
        replace_durably(files[-1], content.encode())
    if PMTILES in formats:
        files.append(job.out / f"{NAME}.pmtiles")
        named = {"name": NAME, "attribution": job.settings.attribution, "type": "overlay", **job.tags}
        write_pmtiles(files[-1], pictures, bounds, metadata=named)
    return RenderedGrid(crs=grid.crs, pixel_m=grid.pixel_m, zoom=zoom, brought_up=found), files


def _web_grid(job: _Job) -> RasterGrid:
    """The zoom as fine as the resolution where the first drive with poses began."""
    path = next(one.path for one in job.drives if one.path is not None)
    start = wgs84_from_map(MapPosition(float(path.pose[0, 0]), float(path.pose[0, 1])), job.frame)
    return web_mercator_grid(start, resolution_m=job.settings.resolution_m)


def _write_tiles(hands: Hands, layer: GridLayer, found: BroughtUp, pictures: PictureFolder, *, zoom_least: int) -> None:
    """The pictures of what was rendered now, of what is missing, and of all tiles above those."""
    zoom = layer.zoom
    there = {tile for tile in pictures.tiles() if tile.zoom == zoom}
    wanted = {WebTile(zoom, tile.column, tile.row): tile for tile in found.tiles}
    anew = {web for web, tile in wanted.items() if tile in found.rendered or web not in there}
    ordered = sorted(anew, key=lambda one: (one.row, one.column))
    write = partial(write_pictures, layer.bands_folder, pictures)
    hands.do("groups of tiles not drawn", write, together(ordered))
    gone = there - wanted.keys()
    for web in gone:
        pictures.path(web).unlink()
    above = anew | gone
    for _ in range(zoom_least, zoom):
        above = {WebTile(one.zoom - 1, one.column // 2, one.row // 2) for one in above}
        ordered = sorted(above, key=lambda one: (one.row, one.column))
        hands.do("groups of overviews not drawn", pictures.write_overviews, together(ordered))


def write_pictures(bands: BandsFolder, pictures: PictureFolder, tiles: tuple[WebTile, ...]) -> None:
    """The pictures of some tiles, which have bands."""
    for web in tiles:
        pictures.write(web, picture(bands.read(Tile(web.column, web.row))))


def viewer_configuration(
    job: _Job, folder: Path, bounds: tuple[float, float, float, float], *, zooms: tuple[int, int]
) -> str:
    """What the viewer's configuration needs to show the pictures, as a section of TOML."""
    lines = (
        "[[web.rasters]]",
        f"name = {json.dumps(NAME)}",
        f"title = {json.dumps('Lidar, map version ' + job.tags[MAP_VERSION])}",
        'kind = "ortho"',
        f"folder = {json.dumps(str(folder.resolve()))}",
        f"bounds = [{', '.join(f'{edge:.9f}' for edge in bounds)}]",
        f"minzoom = {zooms[0]}",
        f"maxzoom = {zooms[1]}",
        'ending = "png"',
        f"attribution = {json.dumps(job.settings.attribution)}",
    )
    return "\n".join(lines) + "\n"
