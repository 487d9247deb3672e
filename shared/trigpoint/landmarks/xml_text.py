"""Text as XML 1.0 can hold it."""

import re

FORBIDDEN = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")  # XML 1.0, 2.2
REPLACEMENT = "\N{REPLACEMENT CHARACTER}"


def xml_text(text: str) -> str:
    """The text with a replacement for every character no XML document may hold; not escaped yet."""
    return FORBIDDEN.sub(REPLACEMENT, text)
