"""Aerial pictures of a campus as XYZ tiles: streets, roofs and poles, each picture off by its own image's offset."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from trigpoint.geodesy.projection import wgs84_from_map_points
from trigpoint.geodesy.web_tiles import WebTile, tile_coordinates, tile_size_m
from trigpoint_vehicle.core.campus import Campus
from trigpoint_vehicle.core.campus_settings import CampusSettings
from trigpoint_vehicle.core.scene.buildings import away_from_street, footprint_m
from trigpoint_vehicle.core.scene.furniture import Trees
from trigpoint_vehicle.core.scene.ground import KERB_WIDTH_M, STREET_HALF_M
from trigpoint_vehicle.core.scene.markings import marking_corners_m, whole_length
from trigpoint_vehicle.core.scene.world import Scene

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Colour = tuple[int, int, int, int]

ZOOM_MOST, ZOOM_LEAST = 20, 14  # 0.12 m a pixel at Sydney, and the whole campus in a tile or two
TILE_PIXELS = 256
STREET_M, BUILDING_M, POLE_M, SHADOW_M = 8.0, 9.0, 0.45, 3.0
AROUND_M = 15.0  # shown beyond a picture's own ground, as neighbouring pictures overlap
GRASS: Colour = (104, 122, 84, 255)
ASPHALT: Colour = (92, 92, 96, 255)
ROOF: Colour = (164, 140, 122, 255)
SHADE: Colour = (58, 68, 48, 255)
POLE: Colour = (240, 240, 232, 255)
WHITE: Colour = (226, 226, 220, 255)
KERB_STONE: Colour = (150, 150, 146, 255)
CROWN: Colour = (70, 96, 58, 255)
MOTTLE = 10.0  # 1-sigma of the ground's brightness, of 255
MOTTLE_PIXELS = 16  # its patches' size


@dataclass(frozen=True, slots=True, kw_only=True)
class AerialPicture:
    """A picture: its image's name, and its bounds in degrees: west, south, east, north."""

    image: str
    bounds: tuple[float, float, float, float]
    canvas: Image.Image
    column: int
    row: int

    def tiles(self) -> Iterator[tuple[WebTile, Image.Image]]:
        """Every tile with something in it, from the most detailed to the least."""
        canvas, column, row = self.canvas, self.column, self.row
        for zoom in range(ZOOM_MOST, ZOOM_LEAST - 1, -1):
            yield from _cut(canvas, zoom, column, row)
            canvas, column, row = _halved(canvas, column, row)


def aerial_pictures(
    campus: Campus, settings: CampusSettings, *, seed: int, scene: Scene | None = None
) -> Iterator[AerialPicture]:
    """The picture of each image, one after the other: they are large.

    With the scene a lidar looks at they show the same: its buildings, markings, kerbs and trees.
    """
    for number, image in enumerate(campus.imagery.image):
        cell = np.array(divmod(number, settings.imagery.columns)[::-1])
        drawing = _Drawing(campus, settings, number, cell, scene=scene)
        yield drawing.picture(image, np.random.default_rng(seed))


class _Drawing:
    """One picture as it is drawn: the world shifted by the image's offset, on a canvas of whole tiles."""

    def __init__(
        self, campus: Campus, settings: CampusSettings, number: int, cell: Ints, *, scene: Scene | None
    ) -> None:
        self._campus, self._scene, self._shift_m = campus, scene, campus.imagery.offset_m[number]
        extent_m = np.array([settings.streets.width_m, settings.streets.height_m])
        side_m = extent_m / (settings.imagery.columns, settings.imagery.rows)
        low_m, high_m = cell * side_m - AROUND_M, (cell + 1) * side_m + AROUND_M
        self._ground_m = np.array([low_m, (high_m[0], low_m[1]), high_m, (low_m[0], high_m[1])])
        corners = self._world_pixels(self._ground_m)
        self._first = np.floor(corners.min(axis=0) / TILE_PIXELS).astype(int)
        self._size = (np.ceil(corners.max(axis=0) / TILE_PIXELS).astype(int) - self._first) * TILE_PIXELS
        lat_deg, _ = wgs84_from_map_points(self._ground_m[:1], campus.frame)
        self._pixels_per_m = TILE_PIXELS / float(tile_size_m(lat_deg, ZOOM_MOST)[0])

    def picture(self, image: str, random: np.random.Generator) -> AerialPicture:
        """The picture drawn."""
        canvas = self._grass(random)
        draw = ImageDraw.Draw(canvas)
        if self._scene is None:
            self._draw_streets(draw)
        else:
            self._draw_carriageways(draw, self._scene)
        self._draw_landmarks(draw)
        ground = Image.new("L", canvas.size, 0)
        ImageDraw.Draw(ground).polygon(self._pixels(self._ground_m), fill=255)
        canvas.putalpha(ground)
        lat_deg, lon_deg = wgs84_from_map_points(self._ground_m, self._campus.frame)
        bounds = (float(lon_deg.min()), float(lat_deg.min()), float(lon_deg.max()), float(lat_deg.max()))
        column, row = self._first.tolist()
        return AerialPicture(image=image, bounds=bounds, canvas=canvas, column=column, row=row)

    def _grass(self, random: np.random.Generator) -> Image.Image:
        """Mottled ground."""
        patches = random.normal(0.0, MOTTLE, tuple(self._size[::-1] // MOTTLE_PIXELS))
        colours = np.clip(np.array(GRASS[:3]) + patches[..., None], 0, 255).astype(np.uint8)
        width, height = self._size.tolist()
        return Image.fromarray(colours).resize((width, height), Image.Resampling.BICUBIC).convert("RGBA")

    def _draw_streets(self, draw: ImageDraw.ImageDraw) -> None:
        streets, width = self._campus.streets, round(STREET_M * self._pixels_per_m)
        for begin, end in streets.street:
            line = self._pixels(streets.junction_m[[begin, end]] + self._shift_m)
            draw.line(line, fill=ASPHALT, width=width)
            for x, y in line:
                draw.ellipse(_around(x, y, width / 2), fill=ASPHALT)

    def _draw_carriageways(self, draw: ImageDraw.ImageDraw, scene: Scene) -> None:
        """Kerbs, carriageways and markings, all as polygons: Pillow draws wide lines up to a pixel aside."""
        ends_m = scene.ground.street.reshape(-1, 2) * scene.scale + self._shift_m
        for colour, half_m in ((KERB_STONE, STREET_HALF_M + KERB_WIDTH_M), (ASPHALT, STREET_HALF_M)):
            self._draw_pieces(draw, scene, whole_length(half_m), colour)
            for x, y in self._pixels(ends_m):
                draw.ellipse(_around(x, y, half_m * self._pixels_per_m), fill=colour)
        self._draw_pieces(draw, scene, scene.ground.stripe, WHITE)

    def _draw_pieces(self, draw: ImageDraw.ImageDraw, scene: Scene, stripe: Floats, colour: Colour) -> None:
        corners_m = marking_corners_m(scene.ground.street, stripe) * scene.scale
        at = np.array(self._pixels(corners_m.reshape(-1, 2) + self._shift_m)).reshape(-1, 4, 2)
        for corners in at.tolist():
            draw.polygon([tuple(corner) for corner in corners], fill=colour)

    def _draw_landmarks(self, draw: ImageDraw.ImageDraw) -> None:
        landmarks = self._campus.landmarks
        for roof_m in self._roofs_m():
            draw.polygon(self._pixels(roof_m + self._shift_m), fill=ROOF)
        for kind, place_m in zip(landmarks.kind, landmarks.position_m, strict=True):
            if kind == "pole":
                self._draw_pole(draw, place_m + self._shift_m)
        if self._scene is not None:
            self._draw_trees(draw, self._scene.trees)

    def _draw_trees(self, draw: ImageDraw.ImageDraw, trees: Trees) -> None:
        for place_m, radius_m in zip(trees.place_m, trees.crown_radius_m.tolist(), strict=True):
            ((x, y),) = self._pixels((place_m + self._shift_m)[None, :])
            draw.ellipse(_around(x, y, radius_m * self._pixels_per_m), fill=CROWN)

    def _draw_pole(self, draw: ImageDraw.ImageDraw, place_m: Floats) -> None:
        """A pole seen from above: its shadow begins at its base, which is what is labelled."""
        base, tip = self._pixels(np.array([place_m, place_m + (SHADOW_M * 0.8, -SHADOW_M * 0.6)]))
        draw.line([base, tip], fill=SHADE, width=2)
        draw.ellipse(_around(*base, POLE_M * self._pixels_per_m / 2 + 1.0), fill=SHADE)
        draw.ellipse(_around(*base, POLE_M * self._pixels_per_m / 2), fill=POLE)

    def _roofs_m(self) -> Floats:
        """The roofs (n, 4, 2) of buildings: the scene's, else one for each corner, away from the street beside it."""
        if self._scene is not None:
            return self._scene.buildings.corner_m
        landmarks, roofs = self._campus.landmarks, list[Floats]()
        for kind, corner_m in zip(landmarks.kind, landmarks.position_m, strict=True):
            if kind != "pole":
                out = BUILDING_M * away_from_street(self._campus.streets, corner_m)
                roofs.append(footprint_m(corner_m, np.array([-out[1], out[0]]), out))
        return np.array(roofs).reshape(-1, 4, 2)

    def _world_pixels(self, point_m: Floats) -> Floats:
        lat_deg, lon_deg = wgs84_from_map_points(point_m, self._campus.frame)
        return np.column_stack(tile_coordinates(lat_deg, lon_deg, ZOOM_MOST)) * TILE_PIXELS

    def _pixels(self, point_m: Floats) -> list[tuple[float, float]]:
        """Where points (n, 2) of the map frame are on the canvas."""
        at = self._world_pixels(point_m) - self._first * TILE_PIXELS
        return [(float(x), float(y)) for x, y in at]


def _around(x: float, y: float, radius: float) -> tuple[float, float, float, float]:
    return x - radius, y - radius, x + radius, y + radius


def _cut(canvas: Image.Image, zoom: int, column: int, row: int) -> Iterator[tuple[WebTile, Image.Image]]:
    for down in range(canvas.height // TILE_PIXELS):
        for right in range(canvas.width // TILE_PIXELS):
            left, top = right * TILE_PIXELS, down * TILE_PIXELS
            tile = canvas.crop((left, top, left + TILE_PIXELS, top + TILE_PIXELS))
            if tile.getchannel("A").getbbox() is not None:
                yield WebTile(zoom, column + right, row + down), tile


def _halved(canvas: Image.Image, column: int, row: int) -> tuple[Image.Image, int, int]:
    """The canvas one zoom out, on whole tiles there."""
    left, top = column % 2, row % 2
    right, down = canvas.width // TILE_PIXELS, canvas.height // TILE_PIXELS
    wide, high = left + right + (left + right) % 2, top + down + (top + down) % 2
    whole = Image.new("RGBA", (wide * TILE_PIXELS, high * TILE_PIXELS))
    whole.paste(canvas, (left * TILE_PIXELS, top * TILE_PIXELS))
    return whole.reduce(2), column // 2, row // 2
