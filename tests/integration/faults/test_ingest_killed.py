"""Ingest killed under load: nothing acknowledged is lost, nothing is stored twice, every vehicle's order is kept."""

from pathlib import Path

from ingest_load.killing import killed_under_load


def test_what_vehicles_were_acknowledged_survives_five_kills_of_ingest(tmp_path: Path) -> None:
    survived = killed_under_load(tmp_path, kills=5)
    assert survived.acknowledged
    assert survived.kept.sent > 1000
    assert (survived.kept.lost, survived.kept.twice, survived.kept.out_of_order) == (0, 0, 0)
