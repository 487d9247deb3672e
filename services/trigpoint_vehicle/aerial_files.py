"""Aerial pictures of a simulated campus in folders, and the configuration that shows them below its map."""

import json
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from trigpoint.errors import InputError
from trigpoint_vehicle.core.aerial import ZOOM_LEAST, ZOOM_MOST, AerialPicture

ENDING, QUALITY, FASTEST = "webp", 80, 0


@dataclass(frozen=True, slots=True, kw_only=True)
class PictureFolder:
    """A picture's tiles, `{z}/{x}/{y}.webp` in `folder`, and its bounds in degrees: west, south, east, north."""

    image: str
    folder: Path
    bounds: tuple[float, float, float, float]


def write_pictures(pictures: Iterable[AerialPicture], out_dir: Path) -> tuple[PictureFolder, ...]:
    """Each picture in a folder of its image's name. Raises InputError for a folder that cannot be written."""
    found = []
    try:
        for picture in pictures:
            folder = out_dir / picture.image
            for tile, content in picture.tiles():
                path = folder / str(tile.zoom) / str(tile.column) / f"{tile.row}.{ENDING}"
                path.parent.mkdir(parents=True, exist_ok=True)
                content.save(path, "WEBP", quality=QUALITY, method=FASTEST)
            found.append(PictureFolder(image=picture.image, folder=folder, bounds=picture.bounds))
    except OSError as error:
        raise InputError(f"{out_dir}: cannot be written: {error}") from error
    return tuple(found)


def write_viewer_configuration(pictures: Iterable[PictureFolder], data: Path, path: Path) -> None:
    """The configuration at a path. Raises InputError where it cannot be written."""
    try:
        path.write_text(viewer_configuration(pictures, data), encoding="utf-8")
    except OSError as error:
        raise InputError(f"{path}: cannot be written: {error}") from error


def viewer_configuration(pictures: Iterable[PictureFolder], data: Path) -> str:
    """What `trigpoint serve http --config` needs to show a data directory with its pictures."""
    lines = ["[fleet]", f"data = {json.dumps(str(data.resolve()))}", "", "[web]", "listen_to_bus = false"]
    for one in pictures:
        west, south, east, north = one.bounds
        lines += [
            "",
            "[[web.rasters]]",
            f"name = {json.dumps(one.image)}",
            f"title = {json.dumps(f'Aerial picture {one.image}')}",
            f"folder = {json.dumps(str(one.folder.resolve()))}",
            f"bounds = [{west:.9f}, {south:.9f}, {east:.9f}, {north:.9f}]",
            f"minzoom = {ZOOM_LEAST}",
            f"maxzoom = {ZOOM_MOST}",
            f"ending = {json.dumps(ENDING)}",
            'attribution = "Simulated"',
            f"images = [{json.dumps(one.image)}]",
        ]
    return "\n".join(lines) + "\n"
