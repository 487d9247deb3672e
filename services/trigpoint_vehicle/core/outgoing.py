"""A message on its way from where it is kept to the bus, as light as can be: there are many a second."""

from dataclasses import dataclass
from typing import NamedTuple


@dataclass(frozen=True, slots=True, eq=False)
class SendChannel:
    """What many messages have in common; compared by identity."""

    source: str
    boot_id: str
    schema_name: str
    key: str


class Outgoing(NamedTuple):
    """A message; `is_data` is False for one that only stands for a message that is gone. Where it comes from a spool,
    `spooled_ns` is when it was spooled, and `segment` the number of its file.
    """

    channel: SendChannel
    sequence: int
    stamp_ns: int
    payload: bytes
    spooled_ns: int = 0
    segment: int = 0
    is_data: bool = True
