"""`python -m replayed_fleets FOLDER DRIVES [ADDRESS]`: the drive recorded in FOLDER/log replayed as DRIVES and rendered
as web tiles into FOLDER/out, by threads or the workers of a Dask scheduler; says how fast and how large as JSON."""

import json
import resource
import sys
import time
from functools import partial
from pathlib import Path

from replayed_fleets.replaying import points_of, replayed_log
from trigpoint.workers import workers
from trigpoint_tiles.app import PMTILES, render_ortho
from trigpoint_tiles.hands import Hands

KIBIBYTE = 1024


def told(done: int, total: int) -> None:
    """One line of progress, over the one before."""
    sys.stderr.write(f"\r{done} of {total}   ")


def main() -> None:
    """Renders and says what it took."""
    folder, drives, address = Path(sys.argv[1]), int(sys.argv[2]), (*sys.argv[3:], "")[0]
    opened = partial(replayed_log, (folder / "log").absolute(), drives)
    with opened() as log, workers(address) as some:
        began_s, busy_s = time.perf_counter(), time.process_time()
        hands = Hands(some, opened, laying_out=told, rendering=told)
        found = render_ortho(log, folder / "out", formats=(PMTILES,), hands=hands)
        wall_s, cpu_s = time.perf_counter() - began_s, time.process_time() - busy_s
    done = found.grids[0].brought_up
    assert sum(one.points for one in done.counts.values()) == points_of(drives)
    said = {"points": points_of(drives), "wall_s": wall_s, "cpu_s": cpu_s, "tiles": len(done.tiles)}
    peak_bytes = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * KIBIBYTE
    sys.stdout.write(json.dumps(said | {"peak_bytes": peak_bytes}) + "\n")


if __name__ == "__main__":
    main()
