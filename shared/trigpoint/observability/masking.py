"""Texts without the secrets in them."""

import re

MASK = "***"
PASSWORD_IN_URL = re.compile(r"(?P<before>://[^\s/:@]*:)(?P<password>[^\s/]*)(?=@)")


def without_password(text: str) -> str:
    """The text with the password of every URL in it masked."""
    return PASSWORD_IN_URL.sub(rf"\g<before>{MASK}", text)
