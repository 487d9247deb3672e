"""Where a payload's numbers and texts stand: messages laid out alike are checked together, without decoding each."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from google.protobuf.descriptor import Descriptor, FieldDescriptor
from numpy.typing import NDArray

VARINT, FIXED64, LENGTH = 0, 1, 2  # wire types (protobuf.dev, Encoding)
VARINT_LONGEST = 10  # bytes
DOUBLE_BYTES = 8


@dataclass(frozen=True, slots=True)
class Slot:
    """A part of a payload that may differ between messages of one shape: the bytes [start, stop) of a field, named by
    message and field as in "ImuMeasured.yaw_rate_radps".
    """

    field: str
    start: int
    stop: int
    is_text: bool


@dataclass(frozen=True, slots=True)
class PayloadShape:
    """What payloads of one length have in common. `example` (L,) uint8; `mask` (L,) uint8 has the bits that are the
    same in all of them: every bit of tags and lengths, of a text the highest (it is ASCII), of a number none.
    """

    example: NDArray[np.uint8]
    mask: NDArray[np.uint8]
    texts: tuple[Slot, ...]
    numbers: tuple[Slot, ...]
    number_starts: NDArray[np.intp]

    def fits(self, table: NDArray[np.uint8]) -> NDArray[np.bool_]:
        """Which rows (n, L) have this shape."""
        differing = (table ^ self.example) & self.mask
        if not differing.any():
            return np.ones(len(table), dtype=np.bool_)
        return np.asarray(~differing.any(axis=1))

    def values(self, table: NDArray[np.uint8]) -> NDArray[np.float64]:
        """The numbers (n, k) of rows of this shape."""
        count, length = table.shape
        whole = np.ascontiguousarray(table)
        every = np.ndarray((count, max(length - DOUBLE_BYTES + 1, 0)), "<f8", whole, strides=(length, 1))
        return np.asarray(every[:, self.number_starts])  # what begins at each byte, of which numbers are some


def shape_of(descriptor: Descriptor, payload: bytes) -> PayloadShape | None:
    """The shape of a payload; None where it holds what is not doubles, ASCII texts, whole numbers or messages of them,
    where a field comes twice, or where it is not well formed.
    """
    try:
        slots = list(_slots(descriptor, payload, 0, len(payload)))
    except _Shapeless:
        return None
    texts = tuple(slot for slot in slots if slot.is_text)
    numbers = tuple(slot for slot in slots if not slot.is_text)
    if any(not payload[slot.start : slot.stop].isascii() for slot in texts):
        return None
    mask = np.full(len(payload), 0xFF, dtype=np.uint8)
    for slot in slots:
        mask[slot.start : slot.stop] = 0x80 if slot.is_text else 0
    starts = np.array([slot.start for slot in numbers], dtype=np.intp)
    return PayloadShape(np.frombuffer(payload, dtype=np.uint8), mask, texts, numbers, starts)


class _Shapeless(Exception):
    """The payload has no shape we know."""


def _slots(descriptor: Descriptor, payload: bytes, start: int, stop: int) -> Iterator[Slot]:
    seen: set[int] = set()
    offset = start
    while offset < stop:
        tag, offset = _varint(payload, offset, stop)
        field = descriptor.fields_by_number.get(tag >> 3)
        if field is None or (field.number in seen and not field.is_repeated):
            raise _Shapeless
        seen.add(field.number)
        name, wire_type = f"{descriptor.name}.{field.name}", tag & 7
        if wire_type == FIXED64:
            end = offset + DOUBLE_BYTES
            yield from _numbers(field, name, _span(offset, end, stop))
        elif wire_type == LENGTH:
            length, offset = _varint(payload, offset, stop)
            end = offset + length
            yield from _delimited(field, name, payload, _span(offset, end, stop))
        elif wire_type == VARINT and field.type == FieldDescriptor.TYPE_ENUM:
            _, end = _varint(payload, offset, stop)
        else:
            raise _Shapeless
        offset = end


def _delimited(field: FieldDescriptor, name: str, payload: bytes, span: range) -> Iterator[Slot]:
    if field.type == FieldDescriptor.TYPE_STRING:
        yield Slot(name, span.start, span.stop, is_text=True)
    elif field.type == FieldDescriptor.TYPE_MESSAGE and field.message_type is not None:
        yield from _slots(field.message_type, payload, span.start, span.stop)
    else:
        yield from _numbers(field, name, span)


def _numbers(field: FieldDescriptor, name: str, span: range) -> Iterator[Slot]:
    if field.type != FieldDescriptor.TYPE_DOUBLE or (span.stop - span.start) % DOUBLE_BYTES:
        raise _Shapeless
    for at in span:
        yield Slot(name, at, at + DOUBLE_BYTES, is_text=False)


def _span(start: int, end: int, stop: int) -> range:
    """The bytes from where a field begins to where it ends, at the latest at `stop`; in steps of a number."""
    if end > stop:
        raise _Shapeless
    return range(start, end, DOUBLE_BYTES)


def _varint(payload: bytes, offset: int, stop: int) -> tuple[int, int]:
    """The number at the offset, and where it ends."""
    value = 0
    for index in range(min(VARINT_LONGEST, stop - offset)):
        byte = payload[offset + index]
        value |= (byte & 0x7F) << (7 * index)
        if byte < 0x80:
            return value, offset + index + 1
    raise _Shapeless
