"""A merged configuration as it is shown."""

import tomllib
from pathlib import Path

from trigpoint.configuration.building import configured
from trigpoint.configuration.given import from_environment
from trigpoint.configuration.showing import shown_values, toml_lines
from trigpoint_cli.settings import Settings

GIVEN = {
    "TRIGPOINT_FLEET__DATA": "/d",
    "TRIGPOINT_DATABASE__URL": "postgresql+psycopg://me:gehe:im@host/db",
    "TRIGPOINT_INGEST__STAMPS__JUMP_LIMIT_S": "60",
}


def lines() -> list[str]:
    return list(toml_lines(shown_values(configured(Settings, [from_environment(GIVEN)]))))


def test_every_value_is_shown_with_its_origin() -> None:
    assert 'data = "/d"  # environment TRIGPOINT_FLEET__DATA' in lines()
    assert 'root = "trigpoint"  # default' in lines()


def test_what_is_shown_is_toml_and_means_the_same(tmp_path: Path) -> None:
    tables = tomllib.loads("\n".join(lines()))
    assert tables["ingest"]["stamps"]["jump_limit_s"] == 60.0
    assert tables["http"]["host"] == "127.0.0.1"
    assert "root" not in tables["ingest"]


def test_a_password_is_masked() -> None:
    (line,) = [line for line in lines() if line.startswith("url")]
    assert line.startswith('url = "postgresql+psycopg://me:***@host/db"')


def test_a_value_that_is_not_set_is_a_comment() -> None:
    assert "# password_file is not set  # default" in lines()
