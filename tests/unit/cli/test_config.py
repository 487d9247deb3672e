"""`trigpoint config`, and the configuration that ships."""

from pathlib import Path

import pytest

from command_runs.running import trigpoint

DEPLOY = Path(__file__).parents[3] / "deploy"
EXAMPLE = DEPLOY / "machine.toml"
DATA = "fleet.data=/d"


@pytest.mark.parametrize("path", sorted(DEPLOY.rglob("*.toml")), ids=lambda path: path.name)
def test_a_configuration_that_ships_is_valid(path: Path) -> None:
    run = trigpoint("config", "check", "--config", path)
    assert run.err == ""
    assert run.status == 0


def test_the_configuration_of_one_machine_listens_on_loopback_only() -> None:
    sections = trigpoint("config", "show", "--config", EXAMPLE, "--json").answer["sections"]
    assert sections["http"]["host"]["value"] == "127.0.0.1"
    assert sections["router"]["listen"]["value"] == ["tcp/127.0.0.1:7447"]


def test_show_tells_value_and_origin() -> None:
    sections = trigpoint("config", "show", "--set", DATA, "--json").answer["sections"]
    assert sections["fleet"]["data"] == {"value": "/d", "origin": "flag --set"}
    assert sections["http"]["ingest_port"] == {"value": 9462, "origin": "default"}


def test_a_configuration_that_is_wrong_ends_with_status_2_and_every_complaint() -> None:
    run = trigpoint("config", "check", "--set", "http.up_port=-1", "--set", "htp.up_port=1")
    assert run.status == 2
    assert "[http] up_port = '-1': should be greater than or equal to 0" in run.err
    assert "no section [htp], but http" in run.err


@pytest.mark.parametrize(
    ("flags", "complaint"),
    [
        (("http.up_port=9462",), "[http] up_port = 9462: ingest_port has the same"),
        (("ingest.pending_count=0",), "[ingest] pending_count = '0': should be greater than or equal to 1"),
        (("ingest.vehicle_rate_hz=0",), "[ingest] vehicle_rate_hz = '0': should be greater than 0"),
        (("bus.inbox_capacity=0",), "[bus] inbox_capacity 0: at least 1 is needed"),
        (("bus.connect=router",), "[bus] endpoint 'router': PROTOCOL/HOST:PORT is needed"),
        (("database.url=mysql://h/d",), "[database] url 'mysql': begins with geopackage: or postgresql+psycopg:"),
        (("tracing.endpoint=localhost:4318",), "[tracing] endpoint 'localhost:4318': begins with http://"),
        (("fleet.root=a/b",), "[fleet] name 'a/b' holds /"),
        (("up.services=ingest,ingest",), "[up] services ['ingest', 'ingest']: at least one, and none twice"),
        (("up.services=[]",), "[up] services []: at least one"),
        (("up.backoff_first_s=9", "up.backoff_ceiling_s=3"), "[up] backoff_first_s = 9: at most 3"),
        (("database.password_file=/nowhere",), "[database] password_file /nowhere: cannot be read"),
    ],
)
def test_what_cannot_work_is_named_with_its_section(flags: tuple[str, ...], complaint: str) -> None:
    run = trigpoint("config", "check", *(word for flag in (DATA, *flags) for word in ("--set", flag)))
    assert run.status == 2
    assert complaint in run.err


def test_the_password_of_a_file_is_not_shown(tmp_path: Path) -> None:
    (tmp_path / "password").write_text("geheim\n", encoding="utf-8")
    run = trigpoint("config", "show", "--set", DATA, "--set", f"database.password_file={tmp_path}/password")
    assert run.status == 0
    assert "geheim" not in run.out
