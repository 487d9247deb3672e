"""The colours exported maps are drawn in: one for each kind or vehicle, the same in every format and every run."""

import zlib

# The eight of Okabe and Ito (2008), which people who see colours differently tell apart; black last.
PALETTE = (
    (0, 114, 178),
    (213, 94, 0),
    (0, 158, 115),
    (204, 121, 167),
    (86, 180, 233),
    (230, 159, 0),
    (240, 228, 66),
    (0, 0, 0),
)
KNOWN = {"pole": 0, "corner": 1}


def colour_number(name: str) -> int:
    """Which colour of the palette a kind or a vehicle has."""
    return KNOWN.get(name, zlib.crc32(name.encode()) % len(PALETTE))


def colour_of(name: str) -> tuple[int, int, int]:
    """Red, green and blue (0 to 255) of a kind or a vehicle."""
    return PALETTE[colour_number(name)]
