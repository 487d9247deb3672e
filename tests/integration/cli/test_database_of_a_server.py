"""Commands on a landmark database that stands on a server: named by flag, environment or the data directory's file."""

from pathlib import Path

import pytest

from command_runs.running import trigpoint
from landmark_databases.cluster import Cluster
from landmark_maps.examples import append_mapped, pin_frame, solved_landmark, solved_map
from trigpoint.landmarks.postgis_store import PostgisStore
from trigpoint.logs.mcap_log import McapLog
from trigpoint_landmarks.app import project

pytestmark = pytest.mark.postgis


@pytest.fixture
def url(postgis_url: str, tmp_path: Path) -> str:
    """A database of a data directory's log of two versions."""
    log = McapLog(tmp_path / "log")
    pin_frame(log)
    append_mapped(log, solved_map(1, [solved_landmark("L1", 0.0, 0.0), solved_landmark("L2", 9.0, 0.0)]))
    append_mapped(log, solved_map(2, [solved_landmark("L1", 0.0, 0.0, map_version=2)]))
    store = PostgisStore(postgis_url)
    project(log, store)
    store.close()
    log.close()
    return postgis_url


def count(tmp_path: Path, *words: str) -> int:
    found: int = trigpoint("landmarks", "--data", tmp_path, *words, "--json").answer["landmarks"]["count"]
    return found


def test_landmarks_are_read_from_the_server_a_flag_names(url: str, tmp_path: Path) -> None:
    assert count(tmp_path, "--database", url) == 1


def test_an_older_version_is_there_too(url: str, tmp_path: Path) -> None:
    assert count(tmp_path, "--database", url, "--as-of", "1") == 2


def test_the_environment_names_it(url: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TRIGPOINT_DATABASE__URL", url)
    assert count(tmp_path) == 1


def test_the_data_directory_names_it_and_the_password_file(url: str, tmp_path: Path, postgis: Cluster) -> None:
    (tmp_path / "trigpoint.toml").write_text(
        f'[database]\nurl = "{url}"\npassword_file = "{postgis.password_file}"\n', encoding="utf-8"
    )
    assert count(tmp_path) == 1


def test_a_replay_differs_in_nothing(url: str, tmp_path: Path) -> None:
    assert trigpoint("replay", "--data", tmp_path, "--database", url, "--json").answer["differences"] == 0


def test_a_password_on_the_command_line_is_refused_and_not_repeated(tmp_path: Path) -> None:
    ran = trigpoint("landmarks", "--data", tmp_path, "--database", "postgresql+psycopg://u:hidden@127.0.0.1/m")
    assert (ran.status, "hidden" in ran.err + ran.out) == (2, False)
    assert "--password-file" in ran.err


def test_a_server_that_is_away_is_a_failure_of_the_environment(tmp_path: Path) -> None:
    ran = trigpoint("landmarks", "--data", tmp_path, "--database", "postgresql+psycopg://u@127.0.0.1:1/m")
    assert (ran.status, "127.0.0.1:1/m" in ran.err) == (1, True)
