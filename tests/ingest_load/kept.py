"""What of the messages of vehicles is in a log: which are missing, doubled or out of order."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from trigpoint.logs.mcap_log import McapLog


@dataclass(frozen=True, slots=True, kw_only=True)
class Kept:
    """Of all vehicles together: messages sent, and of them how many are not in the log, are there again, or stand
    behind a later one."""

    sent: int
    lost: int
    twice: int
    out_of_order: int


def kept_of(log_folder: Path, sent: Mapping[str, tuple[str, int]]) -> Kept:
    """What a log holds of what vehicles sent, by vehicle its boot and how many messages."""
    log = McapLog(log_folder)
    lost = twice = out_of_order = 0
    for vehicle, (boot_id, count) in sent.items():
        runs = [run for run in log.read_headers(f"veh-{vehicle}") if run.boot_id == boot_id]
        sequences = np.concatenate([run.sequences for run in runs]) if runs else np.empty(0, dtype=np.int64)
        found = np.unique(sequences)
        lost += count - len(np.intersect1d(found, np.arange(count)))
        twice += len(sequences) - len(found)
        out_of_order += int((np.diff(sequences) < 0).sum())
    log.close()
    return Kept(sent=sum(count for _, count in sent.values()), lost=lost, twice=twice, out_of_order=out_of_order)
