"""`python -m fuzzed_decoders --inputs 200000`: every decoder fed; what came of it as one JSON object.

Three quarters of the inputs are led by coverage, a sixth are valid ones changed by property-based fuzzing, the rest
are messages of whole streams through ingest. Status 1 if anything crashed or a valid event was lost.
"""

import argparse
import json
import sys
import traceback
from dataclasses import asdict
from pathlib import Path

from fuzzed_decoders.guided_runs import guided
from fuzzed_decoders.property_runs import fed
from fuzzed_decoders.seeds import seeds
from fuzzed_decoders.streams import StreamTally, ingested_stream
from fuzzed_decoders.targets import Decoder, decoders, fast_folder

GUIDED, CHANGED = 0.75, 0.15  # shares of all inputs
SLOW = ("log file", "CSV anchors", "GeoJSON anchors", "GeoPackage anchors")  # files and libraries of others
SLOW_SHARE = 0.25  # of what the others get
STREAM_MESSAGES = 2000


def shares(chosen: tuple[Decoder, ...], count: float) -> dict[str, int]:
    """So many inputs dealt out to the decoders."""
    weights = {one.name: SLOW_SHARE if one.name in SLOW else 1.0 for one in chosen}
    return {name: round(count * weight / sum(weights.values())) for name, weight in weights.items()}


def changed_inputs(count: float, *, seed: int) -> tuple[int, list[str]]:
    """How many changed inputs were fed, and the crashes."""
    inputs, crashes = 0, []
    with fast_folder() as folder:
        chosen, begun = decoders(Path(folder)), seeds(Path(folder))
        for decoder in chosen:
            wanted = shares(chosen, count)[decoder.name]
            try:
                inputs += fed(decoder, begun[decoder.name], count=wanted, seed=seed)[0]
            except Exception:  # whatever it is, it is what we are here for
                crashes.append(f"{decoder.name}: {traceback.format_exc()[-2000:]}")
    return inputs, crashes


def guided_inputs(count: float, *, seed: int) -> tuple[int, list[str]]:
    """How many inputs coverage led to, and the crashes."""
    with fast_folder() as folder:
        wanted = shares(decoders(Path(folder)), count)
    runs = [guided(name, runs=share, seed=seed) for name, share in wanted.items()]
    return sum(run.inputs for run in runs), [run.crash for run in runs if run.crash]


def stream_inputs(count: float, *, seed: int) -> StreamTally:
    """What came of streams of so many messages together."""
    tallies = [
        ingested_stream(count=STREAM_MESSAGES, seed=seed + number)
        for number in range(max(1, round(count / STREAM_MESSAGES)))
    ]
    columns = {name: sum(asdict(one)[name] for one in tallies) for name in asdict(tallies[0])}
    return StreamTally(**columns)


def main() -> int:
    """The exit status after everything was fed."""
    parser = argparse.ArgumentParser(prog="fuzzed_decoders")
    parser.add_argument("--inputs", type=int, required=True)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    led, led_crashes = guided_inputs(GUIDED * options.inputs, seed=options.seed)
    changed, changed_crashes = changed_inputs(CHANGED * options.inputs, seed=options.seed)
    stream = stream_inputs(options.inputs - led - changed, seed=options.seed)
    crashes = [*led_crashes, *changed_crashes]
    answer = {
        "inputs": led + changed + stream.sent,
        "guided": led,
        "changed": changed,
        "crashes": len(crashes),
        "crashed": crashes,
        "stream": asdict(stream),
    }
    sys.stdout.write(json.dumps(answer) + "\n")
    return 1 if crashes or stream.lost or stream.doubled or stream.malformed_kept else 0


if __name__ == "__main__":
    sys.exit(main())
