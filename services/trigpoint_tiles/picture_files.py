"""Pictures for the web: a folder of XYZ tiles, from which a PMTiles archive can be made. Pillow's and pmtiles' home."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image
from pmtiles.tile import Compression, TileType, zxy_to_tileid
from pmtiles.writer import write

from trigpoint.durable_files import replaced_durably
from trigpoint.errors import InputError
from trigpoint.geodesy.web_tiles import WebTile, tile_edges_deg
from trigpoint_tiles.core.mosaics import TileFile
from trigpoint_tiles.core.pictures import Picture, from_farther

PNG_LEVEL = 6
ENDINGS = (".png", ".jpg", ".jpeg", ".webp")
COLOURS = {"L": (1, False), "LA": (1, True), "RGB": (3, False), "RGBA": (3, True)}  # how many, and alpha, by mode
E7 = 1e7
Bounds = tuple[float, float, float, float]


@dataclass(frozen=True, slots=True)
class PictureFolder:
    """`{z}/{x}/{y}.png` tiles of WebMercatorQuad in a folder."""

    folder: Path

    def path(self, tile: WebTile) -> Path:
        """Where a tile stands."""
        return self.folder / str(tile.zoom) / str(tile.column) / f"{tile.row}.png"

    def write(self, tile: WebTile, picture: Picture) -> None:
        """A tile's picture (256, 256, 2) in its place, or none there where nothing is to be seen in it."""
        path = self.path(tile)
        if not picture[..., 1].any():
            path.unlink(missing_ok=True)
            return
        path.parent.mkdir(parents=True, exist_ok=True)
        partial = path.with_suffix(".part")
        Image.fromarray(picture, "LA").save(partial, "PNG", compress_level=PNG_LEVEL)
        partial.replace(path)

    def read(self, tile: WebTile) -> Picture | None:
        """A tile's picture (256, 256, 2), None where there is none."""
        try:
            with Image.open(self.path(tile)) as image:
                return np.asarray(image, dtype=np.uint8)
        except FileNotFoundError:
            return None

    def write_overviews(self, tiles: Iterable[WebTile]) -> None:
        """Tiles anew from those one zoom below them."""
        for tile in tiles:
            self.write(tile, from_farther(self._children(tile)))

    def _children(self, parent: WebTile) -> dict[tuple[int, int], Picture]:
        found = {}
        for right in (0, 1):
            for down in (0, 1):
                child = self.read(WebTile(parent.zoom + 1, 2 * parent.column + right, 2 * parent.row + down))
                if child is not None:
                    found[right, down] = child
        return found

    def tiles(self) -> Iterator[WebTile]:
        """Every tile there is."""
        return (tile for tile, path in xyz_tiles(self.folder) if path.suffix == ".png")


def xyz_tiles(folder: Path) -> Iterator[tuple[WebTile, Path]]:
    """Every picture `{z}/{x}/{y}.<ending>` in a folder, anybody's: what is not named like a tile is passed over."""
    for path in folder.glob("*/*/*.*"):
        names = (path.parent.parent.name, path.parent.name, path.stem)
        if path.suffix in ENDINGS and all(name.isdecimal() for name in names):
            zoom, column, row = map(int, names)
            yield WebTile(zoom, column, row), path


def tile_file(path: Path) -> TileFile:
    """What a tile's file is like. Raises InputError for one that is no picture, not square, or not of grey or colours
    of 8 bits."""
    try:
        with Image.open(path) as image:
            size, mode = image.size, image.mode
    except OSError as error:
        raise InputError(f"{path}: no picture can be read here: {error}") from error
    if size[0] != size[1] or mode not in COLOURS:
        raise InputError(f"{path}: {size[0]} x {size[1]} pixels of mode {mode}: square ones of {', '.join(COLOURS)}")
    colours, alpha = COLOURS[mode]
    return TileFile(path=str(path.resolve()), side_px=size[0], colours=colours, alpha=alpha)


def bounds_deg(tiles: Iterable[WebTile]) -> Bounds:
    """West, south, east and north, in degrees, of at least one tile."""
    edges = np.array([tile_edges_deg(tile) for tile in tiles])
    west, south = edges[:, :2].min(axis=0).tolist()
    east, north = edges[:, 2:].max(axis=0).tolist()
    return west, south, east, north


def write_pmtiles(path: Path, pictures: PictureFolder, bounds: Bounds, *, metadata: Mapping[str, object]) -> None:
    """The tiles of a folder, one at least, as one PMTiles archive (version 3), clustered, in place of what stood there
    once it is whole."""
    tiles = {zxy_to_tileid(tile.zoom, tile.column, tile.row): tile for tile in pictures.tiles()}
    west, south, east, north = (round(edge * E7) for edge in bounds)
    header = {
        "tile_type": TileType.PNG,
        "tile_compression": Compression.NONE,
        "min_lon_e7": west,
        "min_lat_e7": south,
        "max_lon_e7": east,
        "max_lat_e7": north,
        "center_zoom": min(tile.zoom for tile in tiles.values()),
        "center_lon_e7": (west + east) // 2,
        "center_lat_e7": (south + north) // 2,
    }
    with replaced_durably(path) as partial, write(str(partial)) as archive:
        for number in sorted(tiles):
            archive.write_tile(number, pictures.path(tiles[number]).read_bytes())
        archive.finalize(header, dict(metadata))
