"""`python -m fuzzed_decoders.guided --folder DIR --runs N`: one decoder, or all, under atheris in an empty folder.

What leads its way is the coverage of our own code. It ends with status 0 after all runs; a crash, a hang of ten
seconds or more than 2 GB end it with another status, and the input that did it in hexadecimal on standard error.
"""

import argparse
import sys
from pathlib import Path

import atheris  # type: ignore[import-untyped]

with atheris.instrument_imports(
    include=["trigpoint", "trigpoint_cli", "trigpoint_ingest", "trigpoint_landmarks", "trigpoint_vehicle"]
):
    from fuzzed_decoders.seeds import seeds
    from fuzzed_decoders.targets import Decoder, decoders

ALL = "all"


def fuzzed(chosen: tuple[Decoder, ...], corpus: Path, *, runs: int, seed: int, artifacts: Path) -> None:
    """Never returns: the process ends after so many runs, or at the first crash."""

    def one_input(data: bytes) -> None:
        decoder = chosen[data[0] % len(chosen)] if len(chosen) > 1 and data else chosen[0]
        rest = data[1:] if len(chosen) > 1 else data
        try:
            decoder.takes(rest)
        except BaseException:
            sys.stderr.write(f"{decoder.name}: {rest.hex()}\n")
            raise

    limits = (f"-runs={runs}", f"-seed={seed}", "-timeout=10", "-rss_limit_mb=2048", "-max_len=8192", "-verbosity=0")
    atheris.Setup(
        [sys.argv[0], str(corpus), *limits, f"-artifact_prefix={artifacts}/", "-print_final_stats=1"], one_input
    )
    atheris.Fuzz()


def main() -> None:
    """One decoder by name, or all of them in one process."""
    parser = argparse.ArgumentParser(prog="fuzzed_decoders.guided")
    parser.add_argument("--folder", type=Path, required=True)
    parser.add_argument("--decoder", default=ALL)
    parser.add_argument("--runs", type=int, required=True)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    folder: Path = options.folder
    chosen = tuple(one for one in decoders(folder) if options.decoder in (ALL, one.name))
    if not chosen:
        parser.error(f"no decoder is called {options.decoder!r}")
    corpus = folder / "corpus"
    corpus.mkdir()
    begun = seeds(folder)
    for number, decoder in enumerate(chosen):
        for index, data in enumerate(begun[decoder.name]):
            head = bytes([number]) if len(chosen) > 1 else b""
            (corpus / f"{number}-{index}").write_bytes(head + data)
    fuzzed(chosen, corpus, runs=options.runs, seed=options.seed, artifacts=folder)


if __name__ == "__main__":
    main()
