"""The systemd units, by systemd's own judgement and against the command and its configuration."""

import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from command_runs.running import trigpoint
from trigpoint.configuration.building import configured
from trigpoint.configuration.given import from_environment, from_toml
from trigpoint.configuration.sections import ServeSettings
from trigpoint_cli.serve import SERVICES
from trigpoint_cli.settings import Settings

UNITS = Path(__file__).parents[3] / "deploy" / "systemd"
TEMPLATE, ROUTER = "trigpoint@.service", "trigpoint-router.service"
INSTALLED = "/opt/trigpoint/bin/trigpoint"
EXPOSURE_LIMIT = 2.0  # of 10, as `systemd-analyze security` counts; 1.3 with systemd 252

needs_systemd = pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="systemd-analyze is not installed")


def lines_of(unit: str, key: str) -> list[str]:
    """The values of a key of a unit, in order."""
    text = (UNITS / unit).read_text(encoding="utf-8")
    return [line.partition("=")[2] for line in text.splitlines() if line.partition("=")[0] == key]


def environment_of(*units: str) -> dict[str, str]:
    return dict(line.split("=", 1) for unit in units for line in lines_of(unit, "Environment"))


def settings_under(*units: str) -> Settings:
    """The configuration as a process of these units has it."""
    return configured(
        Settings, [from_toml(UNITS / "trigpoint.toml"), from_environment(environment_of(*units))]
    ).settings


@pytest.fixture
def units(tmp_path: Path) -> Path:
    """The units, with the command of this environment in place of the installed one."""
    shutil.copytree(UNITS, tmp_path / "units")
    own = str(Path(sys.executable).with_name("trigpoint"))
    for unit in (tmp_path / "units").glob("*.service"):
        unit.write_text(unit.read_text(encoding="utf-8").replace(INSTALLED, own), encoding="utf-8")
    shutil.copy(tmp_path / "units" / TEMPLATE, tmp_path / "units" / "trigpoint@ingest.service")
    return tmp_path / "units"


def analysed(*words: str | Path) -> str:
    """What systemd says; fails where it complains."""
    finished = subprocess.run(["systemd-analyze", *map(str, words)], capture_output=True, text=True, check=False)
    assert finished.returncode == 0, finished.stdout + finished.stderr
    return finished.stdout + finished.stderr


@needs_systemd
def test_systemd_finds_nothing_wrong_with_the_units(units: Path) -> None:
    names = (ROUTER, "trigpoint@ingest.service", "trigpoint.target")
    assert analysed("verify", "--man=no", *(units / name for name in names)).strip() == ""


@needs_systemd
@pytest.mark.parametrize("unit", [ROUTER, "trigpoint@ingest.service"])
def test_the_units_expose_little(units: Path, unit: str) -> None:
    said = re.search(r"exposure level for \S+ ([\d.]+)", analysed("security", "--offline=true", units / unit))
    assert said is not None
    assert float(said[1]) <= EXPOSURE_LIMIT


@pytest.mark.parametrize("unit", [TEMPLATE, ROUTER])
def test_a_unit_runs_a_command_that_there_is_with_the_installed_configuration(unit: str) -> None:
    (line,) = lines_of(unit, "ExecStart")
    program, *words = shlex.split(line.replace("%i", "ingest"))
    assert program == INSTALLED
    assert words[-2:] == ["--config", "/etc/trigpoint/trigpoint.toml"]
    assert trigpoint(*words, "--help").status == 0


@pytest.mark.parametrize("unit", [TEMPLATE, ROUTER])
def test_a_unit_is_locked_up_started_again_and_given_time(unit: str) -> None:
    wanted = {"NoNewPrivileges": "yes", "ProtectSystem": "strict", "ProtectHome": "yes", "Restart": "on-failure"}
    assert {key: lines_of(unit, key)[-1] for key in wanted} == wanted
    assert lines_of(unit, "User") == ["trigpoint"]
    assert int(lines_of(unit, "TimeoutStopSec")[0].removesuffix("s")) > ServeSettings().stop_limit_s


def test_only_services_write_and_only_where_the_data_is() -> None:
    assert lines_of(TEMPLATE, "ReadWritePaths") == [str(settings_under(TEMPLATE).fleet.data)]
    assert lines_of(ROUTER, "ReadWritePaths") == []


@pytest.mark.parametrize(
    ("units_of_process", "section"),
    [((TEMPLATE,), "bus"), ((ROUTER,), "router"), ((TEMPLATE, "trigpoint@landmarks.service.d/database.conf"), "bus")],
)
def test_a_process_uses_the_credentials_its_unit_loads(units_of_process: tuple[str, ...], section: str) -> None:
    settings = settings_under(*units_of_process)
    files = getattr(settings, section).tls
    named = {files.authority_file, files.certificate_file, files.key_file, settings.database.password_file} - {None}
    loaded = {line.split(":")[0] for unit in units_of_process for line in lines_of(unit, "LoadCredential")}
    assert {str(path) for path in named} == {f"%d/{name}" for name in loaded}


def test_the_target_wants_every_service() -> None:
    (wanted,) = lines_of("trigpoint.target", "Wants")
    assert set(wanted.split()) == {ROUTER, *(f"trigpoint@{name}.service" for name in SERVICES)}


def test_the_example_configuration_listens_protected_and_reads_the_register() -> None:
    router = settings_under(ROUTER).router
    assert all(endpoint.startswith("tls/") for endpoint in router.listen)
    assert str(router.register_file) == "/etc/trigpoint/public/register.json"
