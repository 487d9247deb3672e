"""Over a receiver's loss of what it had acknowledged, as after an older backup: the rest is not stuck behind it.

A receiver acknowledges up to its first missing number. If that is a number its vehicle let go of, because it was
acknowledged once, nothing behind it ever would be: so each such number is told to be gone, or, where it is the
description of the boot, is sent again.
"""

from collections.abc import Mapping

from trigpoint.events.envelope import EventIdentity
from trigpoint.events.uplink import DROPPED_SCHEMA
from trigpoint_vehicle.core.outgoing import Outgoing, SendChannel

BRIDGED_TOGETHER = 8192  # numbers; the next ones follow when these are acknowledged


def bridge(
    said: EventIdentity | None, oldest: Outgoing, descriptions: Mapping[str, Outgoing], *, key: str
) -> list[Outgoing]:
    """What to send between the receiver's last acknowledgement and the oldest message there still is; `descriptions`
    are those known of each boot. Nothing where no number is missing between the two.
    """
    boot_id = oldest.channel.boot_id
    if said is None or said.boot_id != boot_id or said.sequence < -1:
        return []
    first = said.sequence + 1
    gone = SendChannel(oldest.channel.source, boot_id, DROPPED_SCHEMA, key)
    described = descriptions.get(boot_id)
    return [
        described
        if described is not None and described.sequence == number
        else Outgoing(gone, number, 0, b"", is_data=False)
        for number in range(first, min(oldest.sequence, first + BRIDGED_TOGETHER))
    ]
