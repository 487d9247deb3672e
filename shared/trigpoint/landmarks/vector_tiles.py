"""Mapbox Vector Tiles, version 2.1, as bytes: layers of points and lines with their properties.

Protobuf's wire format, written directly: a tile is few fields of few kinds, and there are many of them.
"""

import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

Value = str | bool | int | float
TilePoints = Sequence[tuple[int, int]]

VERSION = 2
POINT, LINE = 1, 2  # kinds of geometry
MOVE_TO, LINE_TO = 1, 2  # commands
_DOUBLE = struct.Struct("<d")


@dataclass(frozen=True, slots=True)
class TileFeature:
    """A point (`parts`: one of one place) or lines in a tile's units; properties without a value are left out."""

    parts: Sequence[TilePoints]
    properties: Mapping[str, Value | None]
    is_line: bool = False


def encoded_layer(name: str, features: Sequence[TileFeature], *, extent: int) -> bytes:
    """A tile of one layer; nothing for no features."""
    if not features:
        return b""
    keys: dict[str, int] = {}
    values: dict[tuple[type, Value], int] = {}
    drawn = [_field(2, _feature(feature, keys, values)) for feature in features]
    content = [
        _field(1, name.encode()),
        *drawn,
        *(_field(3, key.encode()) for key in keys),
        *(_field(4, _value(value)) for _, value in values),
        _number(5, extent),
        _number(15, VERSION),
    ]
    return _field(3, b"".join(content))


def _feature(feature: TileFeature, keys: dict[str, int], values: dict[tuple[type, Value], int]) -> bytes:
    tags = bytearray()
    for key, value in feature.properties.items():
        if value is not None:
            tags += _varint(keys.setdefault(key, len(keys)))
            tags += _varint(values.setdefault((type(value), value), len(values)))
    kind = LINE if feature.is_line else POINT
    return _field(2, bytes(tags)) + _number(3, kind) + _field(4, _geometry(feature.parts))


def _geometry(parts: Sequence[TilePoints]) -> bytes:
    """Each part a move to its first place and lines to the others, every place as its way from the one before."""
    written = bytearray()
    x = y = 0
    for part in parts:
        for index, place in enumerate(part):
            if index < 2:
                count = 1 if index == 0 else len(part) - 1
                written += _varint(count << 3 | (MOVE_TO if index == 0 else LINE_TO))
            written += _varint(_zigzag(place[0] - x)) + _varint(_zigzag(place[1] - y))
            x, y = place
    return bytes(written)


def _value(value: Value) -> bytes:
    match value:
        case bool():
            return _number(7, int(value))
        case str():
            return _field(1, value.encode())
        case float():
            return b"\x19" + _DOUBLE.pack(value)
        case int() if value >= 0:
            return _number(5, value)
        case _:
            return _number(6, _zigzag(value))


def _zigzag(value: int) -> int:
    return value << 1 if value >= 0 else (-value << 1) - 1


def _varint(value: int) -> bytes:
    if value < 0x80:
        return bytes((value,))
    written = bytearray()
    while value >= 0x80:
        written.append(value & 0x7F | 0x80)
        value >>= 7
    written.append(value)
    return bytes(written)


def _number(field: int, value: int) -> bytes:
    return _varint(field << 3) + _varint(value)


def _field(field: int, content: bytes) -> bytes:
    return _varint(field << 3 | 2) + _varint(len(content)) + content
