"""How QGIS draws the check layer: arrows from the ground to where the image shows it, coloured by their length."""

from xml.etree.ElementTree import Element

from trigpoint.landmarks.qgis_symbols import (
    Colour,
    arrow,
    categorized,
    generated,
    simple_marker,
    style_text,
    symbol,
)

SHIFT_SCALE = "trigpoint_shift_scale"  # a project's variable: how many times as long as they are arrows are drawn
USUAL_SCALE = 20  # decimetres on tiles of 50 m
SMALL_M, LARGE_M = 0.2, 0.5  # a pixel of aerial images, and what people see without measuring
GOOD: Colour = (31, 122, 54)
FAIR: Colour = (198, 124, 0)
BAD: Colour = (179, 32, 42)
REFUSED: Colour = (130, 130, 130)
SIZES = (
    ("small", f"up to {SMALL_M:g} m", GOOD),
    ("middle", f"up to {LARGE_M:g} m", FAIR),
    ("large", f"over {LARGE_M:g} m", BAD),
)
SIZE = (
    "CASE WHEN \"length_m\" IS NULL THEN '' "
    f"WHEN \"length_m\" <= {SMALL_M:g} THEN 'small' WHEN \"length_m\" <= {LARGE_M:g} THEN 'middle' ELSE 'large' END"
)


def check_style() -> str:
    """The layer's style as QML; refused tiles are grey diamonds."""
    told = [(value, label, _arrow(colour, str(number))) for number, (value, label, colour) in enumerate(SIZES)]
    diamond = simple_marker(shape="diamond", colour=REFUSED, size_mm=2.0)
    return style_text(categorized(SIZE, [*told, ("", "refused", symbol("marker", str(len(SIZES)), [diamond]))]))


def _arrow(colour: Colour, name: str) -> Element:
    scale = f"to_real(coalesce(@{SHIFT_SCALE}, {USUAL_SCALE}))"
    tip = f'make_point($x + "shift_east_m" * {scale}, $y + "shift_north_m" * {scale})'
    line = symbol("line", f"@{name}@1", [arrow(colour=colour)])
    dot = simple_marker(shape="circle", colour=colour, size_mm=1.4)
    return symbol("marker", name, [dot, generated(f"make_line($geometry, {tip})", line)])
