"""The demonstration from its first message to its report."""

from pathlib import Path

import pytest

from command_runs.running import trigpoint


@pytest.mark.slow
def test_a_demonstration_leaves_a_data_directory_every_command_works_on(tmp_path: Path) -> None:
    said = trigpoint("demo", "--out", tmp_path / "demo", "--vehicles", 1, "--json")
    assert said.status == 0
    assert said.answer["error_m"]["mean"] < 1.0  # metres: one vehicle, one seed
    assert said.answer["landmarks"]["count"] > 200
    assert set(said.answer["vehicles"]) == {"vehicle-1"}
    assert (tmp_path / "demo" / "report.html").stat().st_size > 100_000
    assert trigpoint("replay", "--data", tmp_path / "demo", "--json").answer["differences"] == 0
