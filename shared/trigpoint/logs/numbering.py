"""Which numbers the events of a damaged file had: counted on from what is certain, back from what follows."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace


@dataclass(frozen=True, slots=True)
class Piece:
    """Some of a file in its order: `count` events that are whole (`lost` False), or gone; None for an unknown number
    gone. `offset` in bytes."""

    offset: int
    count: int | None
    lost: bool = False


@dataclass(frozen=True, slots=True)
class NumberedPiece:
    """A whole piece and the number of its first event; not `certain` where that is the lowest it can have been."""

    offset: int
    count: int
    number: int
    certain: bool = True


def numbered(
    pieces: Sequence[Piece], *, first_number: int, stop_number: int | None, known: Mapping[int, tuple[int, int]]
) -> tuple[NumberedPiece, ...]:
    """The whole pieces with their numbers; of a file that begins at `first_number` and ends, if that is known, before
    `stop_number`. `known`: number and count of the piece at an offset, as it was when it was whole."""
    forward = _counted_on(pieces, first_number, known)
    return forward if stop_number is None else _counted_back(pieces, forward, stop_number)


def _counted_on(
    pieces: Sequence[Piece], number: int, known: Mapping[int, tuple[int, int]]
) -> tuple[NumberedPiece, ...]:
    found, certain = [], True
    for piece in pieces:
        if piece.lost or piece.count is None:
            certain = certain and piece.count is not None
            number += piece.count or 0
            continue
        said, count = known.get(piece.offset, (number, None))
        if count == piece.count and said >= number:
            number, certain = said, True
        found.append(NumberedPiece(piece.offset, piece.count, number, certain))
        number += piece.count
    return tuple(found)


def _counted_back(
    pieces: Sequence[Piece], forward: Sequence[NumberedPiece], stop_number: int
) -> tuple[NumberedPiece, ...]:
    """Those before the end, up to the last unknown loss, set back from it where counting on was not certain."""
    by_offset = {piece.offset: piece for piece in forward}
    for piece in reversed(pieces):
        if piece.count is None:
            break
        stop_number -= piece.count
        numbered_piece = by_offset.get(piece.offset)
        if not piece.lost and numbered_piece and not numbered_piece.certain and stop_number >= numbered_piece.number:
            by_offset[piece.offset] = replace(numbered_piece, number=stop_number, certain=True)
    return tuple(by_offset.values())
