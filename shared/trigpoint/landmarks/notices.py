"""What is told of the map's changes, as Protobuf messages under the keys of its tiles, and put together again."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from trigpoint.errors import InputError
from trigpoint.events.keys import LANDMARK_ZOOM
from trigpoint.geodesy.positions import Wgs84Position
from trigpoint.geodesy.web_tiles import WebTile, tile_at
from trigpoint.landmarks.asked import AnsweredMap, TileChange, VersionChange
from trigpoint.landmarks.messages import decoded_map, landmark_message, landmark_of, map_message, parsed, schema_of
from trigpoint.landmarks.model import Landmark
from trigpoint_schemas.v1 import asked_pb2 as pb

TILE_SCHEMA, VERSION_SCHEMA = schema_of(pb.TileChanged), schema_of(pb.MapChanged)
VERSIONS_WAITING = 64  # told of in tiles, and not yet themselves: more were lost than will come


def tile_of(landmark: Landmark) -> WebTile:
    """The tile of the change feed a landmark lies in."""
    return tile_at(Wgs84Position(landmark.lat_deg, landmark.lon_deg), LANDMARK_ZOOM)


def tile_change_bytes(change: TileChange) -> bytes:
    """A tile's change; which tile it is stands in the key."""
    changed = [landmark_message(landmark) for landmark in change.changed]
    message = pb.TileChanged(before=change.before, after=change.after, changed=changed, removed=change.removed)
    return message.SerializeToString()


def version_change_bytes(change: VersionChange) -> bytes:
    """A version that is durable."""
    tiles = sorted(change.tiles or (), key=lambda tile: (tile.column, tile.row))
    return pb.MapChanged(
        map=map_message(change.map),
        before=change.before,
        zoom=LANDMARK_ZOOM,
        columns=[tile.column for tile in tiles],
        rows=[tile.row for tile in tiles],
        all_tiles=change.tiles is None,
    ).SerializeToString()


def decoded_version_change(payload: bytes) -> VersionChange:
    """A version that is durable. Raises InputError."""
    message = parsed(pb.MapChanged, payload)
    if len(message.columns) != len(message.rows):
        raise InputError(f"{VERSION_SCHEMA}: {len(message.columns)} columns and {len(message.rows)} rows of tiles")
    tiles = (WebTile(message.zoom, *place) for place in zip(message.columns, message.rows, strict=True))
    return VersionChange(
        map=decoded_map(message.map), before=message.before, tiles=None if message.all_tiles else frozenset(tiles)
    )


def tile_of_key(key: str) -> WebTile:
    """The tile a key ends with. Raises InputError."""
    try:
        zoom, column, row = (int(chunk) for chunk in key.split("/")[-3:])
    except ValueError as error:
        raise InputError(f"key {key!r} does not end with zoom, column and row of a tile") from error
    return WebTile(zoom, column, row)


@dataclass(frozen=True, slots=True, kw_only=True)
class Step:
    """From version `before` to that of `map`: landmarks to hold, and ids to hold no more, in the tiles followed."""

    map: AnsweredMap
    before: int
    changed: tuple[Landmark, ...]
    removed: tuple[str, ...]


class StepAssembly:
    """Tiles' changes kept until their version is told of; then they are one step, or a gap."""

    def __init__(self) -> None:
        self._tiles: dict[int, dict[WebTile, pb.TileChanged]] = {}

    def keep(self, tile: WebTile, payload: bytes) -> None:
        """A tile's change kept. Raises InputError for a payload that is none."""
        message = parsed(pb.TileChanged, payload)
        self._tiles.setdefault(message.after, {})[tile] = message
        while len(self._tiles) > VERSIONS_WAITING:
            del self._tiles[min(self._tiles)]

    def missing(self, told: VersionChange, followed: frozenset[WebTile]) -> frozenset[WebTile]:
        """The tiles followed that a version changed, and whose change did not come yet."""
        there = self._tiles.get(told.map.map_version, {})
        return ((told.tiles or frozenset()) & followed) - there.keys()

    def step(self, told: VersionChange, followed: frozenset[WebTile] | None = None) -> Step | None:
        """The step a version is, in the tiles followed (None: all); None where a tile's change did not come."""
        there = self._tiles.pop(told.map.map_version, {})
        for version in [version for version in self._tiles if version < told.map.map_version]:
            del self._tiles[version]
        if told.tiles is None:
            return None
        wanted = told.tiles if followed is None else told.tiles & followed
        if any(tile not in there or there[tile].before != told.before for tile in wanted):
            return None
        return _joined(told, {tile: there[tile] for tile in wanted})


def _joined(told: VersionChange, tiles: Mapping[WebTile, pb.TileChanged]) -> Step:
    """What the tiles say together: a landmark that went from one to another was changed."""
    changed = {one.landmark: landmark_of(one, told.map) for tile in tiles.values() for one in tile.changed}
    removed = {name for tile in tiles.values() for name in tile.removed} - changed.keys()
    return Step(map=told.map, before=told.before, changed=tuple(changed.values()), removed=tuple(sorted(removed)))


def tile_changes(
    *, before: int, after: int, opened: Iterable[tuple[WebTile, Landmark]], closed: Iterable[tuple[WebTile, str]]
) -> tuple[TileChange, ...]:
    """What differs in each tile: landmarks opened where they lie, and ids closed where they lay and do not any more."""
    changed: dict[WebTile, dict[str, Landmark]] = {}
    for tile, landmark in opened:
        changed.setdefault(tile, {})[landmark.landmark] = landmark
    removed: dict[WebTile, list[str]] = {}
    for tile, name in closed:
        if name not in changed.get(tile, {}):
            removed.setdefault(tile, []).append(name)
    return tuple(
        TileChange(
            tile=tile,
            before=before,
            after=after,
            changed=tuple(changed.get(tile, {}).values()),
            removed=tuple(removed.get(tile, ())),
        )
        for tile in sorted(changed.keys() | removed.keys(), key=lambda tile: (tile.column, tile.row))
    )
