"""NCLT: two sessions as two vehicles, GPS and wheels only."""

from pathlib import Path

from figures.figure import Figure, Measurement, at_most
from figures.replayed import unchanged_by_replay
from figures.workbench import Outcome, Workbench

MANIFEST = Path(__file__).with_name("nclt.toml")
SESSIONS = (("nclt-2012-11-04", 0.65), ("nclt-2013-01-10", 1.0))  # the share of the raw error that may be left


def against_truth(bench: Workbench) -> Outcome:
    """What `evaluate truth` says of the loose map of both sessions."""
    raw, data = bench.path("raw"), bench.path("data")
    bench.run("convert", "table", str(MANIFEST), raw, "--source-dir", bench.drive("nclt"))
    bench.run("ingest", *(f"{raw}/{session}.mcap" for session, _ in SESSIONS), "--data", data)
    bench.run("build", "--data", data, "--method", "loose", "--json")
    return bench.run("evaluate", "truth", "--data", data, "--truth", f"{raw}/truth.csv", "--json")


def share_left(session: str, limit: float) -> Figure:
    """Mean error at the instants of fixes over the mean error of raw GPS."""

    def measure(bench: Workbench) -> Measurement:
        outcome = against_truth(bench)
        of_map = outcome.at(f"vehicles.{session}.error_at_fixes_m.mean")
        return Measurement(
            value=of_map / outcome.at(f"vehicles.{session}.raw_fix_error_m.mean"), command=outcome.command
        )

    name = f"{session}: mean error at the instants of fixes over raw GPS's"
    return Figure(name=name, unit="1", target=at_most(limit), measure=measure)


def largest(session: str) -> Figure:
    """The largest error anywhere, gaps included."""

    def measure(bench: Workbench) -> Measurement:
        outcome = against_truth(bench)
        return Measurement(value=outcome.at(f"vehicles.{session}.error_m.max"), command=outcome.command)

    return Figure(name=f"{session}: largest error anywhere", unit="m", target=at_most(30.0), measure=measure)


FIGURES = (
    *(share_left(*session) for session in SESSIONS),
    *(largest(session) for session, _ in SESSIONS),
    unchanged_by_replay("data", against_truth),
)
