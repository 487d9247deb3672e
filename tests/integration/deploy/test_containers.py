"""What deploy/ tells containers, against the command, its configuration and the files that are there."""

import os
import re
import shlex
import subprocess
import sys
import tomllib
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

import pytest
import yaml

from command_runs.processes import Process, trigpoint_process
from command_runs.running import trigpoint
from secured_fleet.fleet import authority_of, secured_configuration
from trigpoint.bus.register import Role
from trigpoint.configuration.building import configured
from trigpoint.configuration.given import from_environment, from_toml
from trigpoint.configuration.sections import HttpSettings, ServeSettings
from trigpoint_cli.serve import SERVICES
from trigpoint_cli.settings import Settings

REPOSITORY = Path(__file__).parents[3]
DEPLOY = REPOSITORY / "deploy"
OURS = ("router", *SERVICES)
SECRETS = "/run/secrets"


def compose() -> dict[str, Any]:
    loaded: dict[str, Any] = yaml.safe_load((DEPLOY / "compose.yaml").read_text(encoding="utf-8"))
    return loaded


def service(name: str) -> dict[str, Any]:
    found: dict[str, Any] = compose()["services"][name]
    return found


def settings_of(name: str) -> Settings:
    """The configuration as a container's process has it."""
    environment = service(name).get("environment", {})
    return configured(Settings, [from_toml(DEPLOY / "containers.toml"), from_environment(environment)]).settings


def secret_paths(name: str) -> set[str]:
    """Where a container finds its secrets."""
    rows = service(name).get("secrets", [])
    return {f"{SECRETS}/{row if isinstance(row, str) else row['target']}" for row in rows}


def instructions() -> list[tuple[str, str]]:
    """The Dockerfile's instructions and their words, lines joined."""
    text = re.sub(r"\\\n\s*", " ", (DEPLOY / "Dockerfile").read_text(encoding="utf-8"))
    lines = [line for line in text.splitlines() if line and not line.startswith("#")]
    return [(line.split()[0], line.partition(" ")[2].strip()) for line in lines]


def words_of(instruction: str) -> list[str]:
    return [words for name, words in instructions() if name == instruction]


def test_every_service_of_the_command_has_a_container_and_no_other_has() -> None:
    assert set(compose()["services"]) == {*OURS, "database"}


@pytest.mark.parametrize("name", OURS)
def test_a_container_is_built_for_its_service_and_its_port(name: str) -> None:
    build = service(name)["build"]
    assert build["args"] == {"SERVICE": name, "PORT": str(HttpSettings().ports()[name])}
    assert (DEPLOY / build["context"] / build["dockerfile"]).resolve() == DEPLOY / "Dockerfile"


@pytest.mark.parametrize("name", OURS)
def test_a_containers_configuration_is_valid_and_names_its_own_secrets(name: str) -> None:
    settings, secrets = settings_of(name), secret_paths(name)
    session = settings.router if name == "router" else settings.bus
    assert session.tls is not None
    named = {str(session.tls.authority_file), str(session.tls.certificate_file), str(session.tls.key_file)}
    extra = {str(path) for path in (settings.database.password_file, settings.web.token_file) if path}
    assert named | extra == secrets


def test_only_who_needs_the_database_has_its_password() -> None:
    holders = [name for name in compose()["services"] if f"{SECRETS}/database_password" in secret_paths(name)]
    assert sorted(holders) == ["answers", "database", "http", "landmarks"]


def test_every_secret_is_declared_used_and_of_a_role_that_exists() -> None:
    declared = compose()["secrets"]
    used = {
        row if isinstance(row, str) else row["source"]
        for name in compose()["services"]
        for row in service(name).get("secrets", [])
    }
    owners = {Path(row["file"]).stem for row in declared.values() if "issued" in row["file"]}
    assert set(declared) == used
    assert {Role(owner) for owner in owners} == {Role(name) for name in OURS}


def test_the_router_sees_the_register_and_not_the_authoritys_key() -> None:
    (mount,) = service("router")["volumes"]
    source, target, mode = mount.split(":")
    assert (source, mode) == ("./authority/public", "ro")
    assert str(settings_of("router").router.register_file) == f"{target}/register.json"


def test_services_find_the_router_and_the_database_under_their_names() -> None:
    (connected,), (listening,) = settings_of("ingest").bus.connect, settings_of("router").router.listen
    assert connected == f"tls/router:{listening.rpartition(':')[2]}"
    assert "@database/" in settings_of("landmarks").database.url
    assert service("database")["environment"]["POSTGRES_DB"] in settings_of("landmarks").database.url


def test_ports_are_published_on_loopback_unless_told_otherwise() -> None:
    published = [port for name in compose()["services"] for port in service(name)["ports"]]
    assert [port for port in published if not port.startswith(("127.0.0.1:", "${TRIGPOINT_ADDRESS:-127.0.0.1}:"))] == []


@pytest.mark.parametrize("name", OURS)
def test_a_container_is_hardened_and_has_time_to_stop(name: str) -> None:
    ours = service(name)
    assert (ours["read_only"], ours["cap_drop"], ours["security_opt"]) == (True, ["ALL"], ["no-new-privileges:true"])
    assert int(ours["stop_grace_period"].removesuffix("s")) > ServeSettings().stop_limit_s
    assert ours["restart"] == "on-failure"


@pytest.mark.parametrize("name", SERVICES)
def test_a_service_has_the_data_and_starts_after_what_it_needs(name: str) -> None:
    ours = service(name)
    assert f"data:{settings_of(name).fleet.data}" in ours["volumes"]
    assert {row["condition"] for row in ours["depends_on"].values()} == {"service_healthy"}
    assert set(ours["depends_on"]) <= set(compose()["services"])
    assert {volume.partition(":")[0] for volume in ours["volumes"]} <= set(compose()["volumes"])


def test_images_are_pinned_to_a_version() -> None:
    bases = [words.split()[0] for words in words_of("FROM")] + [service("database")["image"]]
    assert [base for base in bases if not re.search(r":\d+(\.|-)\d+", base)] == []
    required = tomllib.loads((REPOSITORY / "pyproject.toml").read_text(encoding="utf-8"))["project"]["requires-python"]
    pythons = {base.split("-")[0] for base in bases if base.startswith("python:")}
    assert (pythons, required) == ({"python:3.11"}, ">=3.11")


def test_the_image_runs_as_nobody_special() -> None:
    (user,) = words_of("USER")
    assert re.fullmatch(r"[1-9]\d{4}:[1-9]\d{4}", user)


def test_the_image_is_built_from_files_that_are_there_and_let_in() -> None:
    copied = [words for words in words_of("COPY") if "--from=" not in words]
    sources = [word for words in copied for word in words.split()[:-1] if not word.startswith("--")]
    ignored = (DEPLOY / "Dockerfile.dockerignore").read_text(encoding="utf-8").splitlines()
    allowed = [line[1:] for line in ignored if line.startswith("!")]
    assert [source for source in sources if not (REPOSITORY / source).exists()] == []
    assert [source for source in sources if not any(fnmatch(source, pattern) for pattern in allowed)] == []


def test_the_image_keeps_the_usual_rules() -> None:
    names = [name for name, _ in instructions()]
    runs = " ".join(words_of("RUN"))
    assert "ADD" not in names
    assert "apt-get" not in runs
    assert "--no-cache-dir --constraint constraints.txt" in runs
    assert all(words.startswith("[") for words in words_of("ENTRYPOINT") + words_of("CMD"))
    assert names.index("HEALTHCHECK") > len(names) - 1 - names[::-1].index("FROM")


def test_the_image_installs_what_the_project_calls_so() -> None:
    extras = tomllib.loads((REPOSITORY / "pyproject.toml").read_text(encoding="utf-8"))["project"][
        "optional-dependencies"
    ]
    (asked,) = re.findall(r'"\.\[([\w,]+)\]"', " ".join(words_of("RUN")))
    assert asked.split(",") == ["services", "tracing"]
    assert set(asked.split(",")) <= set(extras)


def health_check(port: int) -> int:
    """The exit status of the image's own health check, run here."""
    (words,) = words_of("HEALTHCHECK")
    command = yaml.safe_load(words.partition("CMD ")[2])
    environment = {**os.environ, "PORT": str(port), "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}"}
    return subprocess.run(command, env=environment, capture_output=True, check=False).returncode


def test_the_health_check_sees_a_process_that_lives_and_one_that_does_not(tmp_path: Path) -> None:
    authority_of(tmp_path)
    fleet = secured_configuration(tmp_path)
    with trigpoint_process(tmp_path, "router", "--config", fleet.config):
        fleet.wait_ready("router")
        assert health_check(fleet.ports["router"]) == 0
    assert health_check(fleet.ports["router"]) != 0


@pytest.mark.parametrize("name", OURS)
def test_the_start_script_becomes_a_command_that_there_is(tmp_path: Path, name: str) -> None:
    shown = tmp_path / "trigpoint"
    shown.write_text('#!/bin/sh\nprintf "%s\\n" "$$" "$@"\n', encoding="utf-8")
    shown.chmod(0o755)
    (entry,), (words,) = words_of("ENTRYPOINT"), words_of("CMD")
    assert entry == '["/usr/local/bin/start"]'
    environment = {"SERVICE": name, "PATH": f"{tmp_path}:/usr/bin:/bin"}
    with subprocess.Popen(
        [DEPLOY / "start", *yaml.safe_load(words)], env=environment, stdout=subprocess.PIPE, text=True
    ) as started:
        pid, *given = started.communicate()[0].splitlines()
    assert int(pid) == started.pid  # in place of the shell: signals reach it
    assert given[-2:] == ["--config", f"{service(name)['configs'][0]['target']}"]
    assert trigpoint(*given[:-2], "--config", DEPLOY / "containers.toml", "--help").status == 0


def test_the_comment_before_the_first_start_names_commands_that_there_are() -> None:
    comment = (DEPLOY / "compose.yaml").read_text(encoding="utf-8").split("\n\n")[0]
    commands = re.findall(r"^#\s+trigpoint ([\w ]+?)(?: --|  |$)", comment, flags=re.MULTILINE)
    statuses = {command: trigpoint(*shlex.split(command)[:2], "--help").status for command in commands}
    assert set(statuses.values()) == {0}


def test_the_router_container_starts_from_its_configuration(tmp_path: Path) -> None:
    """The start script with the real command, on a configuration that differs in paths and ports only."""
    authority_of(tmp_path)
    fleet = secured_configuration(tmp_path)
    path = f"{Path(sys.executable).parent}:{os.environ['PATH']}"
    out, err = tmp_path / "out", tmp_path / "err"
    with out.open("wb") as out_file, err.open("wb") as err_file:
        popen = subprocess.Popen(
            [DEPLOY / "start", "--config", fleet.config],
            env={**os.environ, "SERVICE": "router", "PATH": path},
            stdout=out_file,
            stderr=err_file,
        )
    try:
        fleet.wait_ready("router")
        assert Process(popen, out, err).stop() == 0
    finally:
        popen.kill()
        popen.wait()
