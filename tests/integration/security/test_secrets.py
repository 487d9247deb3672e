"""Secrets stay where they are: not on command lines, not in logs, not in what a command shows."""

from pathlib import Path

import pytest

from command_runs.processes import trigpoint_process, wait_until
from command_runs.running import trigpoint
from secured_fleet.fleet import SecuredFleet, authority_of, secured_configuration

PASSWORD = "p@ss:w/rd-7f3a91"
IN_URL = "p%40ss%3Aw%2Frd-7f3a91"


def database_lines(folder: Path) -> str:
    """A database whose password is in a file, and which nobody answers for."""
    secret = folder / "database_password"
    secret.write_text(f"{PASSWORD}\n", encoding="utf-8")
    secret.chmod(0o600)
    return f'[database]\nurl = "postgresql+psycopg://trigpoint@127.0.0.1:1/trigpoint"\npassword_file = "{secret}"\n'


@pytest.fixture
def fleet(tmp_path: Path) -> SecuredFleet:
    """A fleet's files, without processes."""
    authority = authority_of(tmp_path)
    fleet = secured_configuration(tmp_path, more=database_lines(tmp_path))
    return SecuredFleet(fleet, authority, None)  # type: ignore[arg-type]  # no router here


def key_text(fleet: SecuredFleet, name: str) -> str:
    """The secret part of a key file: its second line."""
    return (fleet.folder / "authority" / "issued" / f"{name}.key").read_text(encoding="utf-8").splitlines()[1]


def test_a_service_with_a_password_and_a_key_shows_neither(fleet: SecuredFleet) -> None:
    config = fleet.fleet.config
    with (
        trigpoint_process(fleet.folder, "router", "--config", config) as router,
        trigpoint_process(
            fleet.folder, "serve", "ingest", "--config", config, "--set", "logging.level=DEBUG"
        ) as ingest,
    ):
        fleet.fleet.wait_ready("router", "ingest")
        commands = [Path(f"/proc/{one.popen.pid}/cmdline").read_bytes().decode() for one in (router, ingest)]
        pages = [fleet.fleet.page(name, path)[1] for name in ("router", "ingest") for path in ("/healthz", "/metrics")]
        assert (router.stop(), ingest.stop()) == (0, 0)
        shown = "".join([*commands, *pages, router.err, ingest.err, router.out, ingest.out])
    secrets = (PASSWORD, IN_URL, key_text(fleet, "services"), key_text(fleet, "router"))
    assert [secret for secret in secrets if secret in shown] == []


def test_a_database_that_does_not_answer_is_told_of_without_its_password(fleet: SecuredFleet) -> None:
    config = fleet.fleet.config
    with (
        trigpoint_process(fleet.folder, "router", "--config", config),
        trigpoint_process(fleet.folder, "serve", "landmarks", "--config", config) as landmarks,
    ):
        wait_until(lambda: "127.0.0.1" in landmarks.err and "WARNING" in landmarks.err, "a warning of the database")
        command = Path(f"/proc/{landmarks.popen.pid}/cmdline").read_bytes().decode()
        landmarks.stop()
        shown = command + landmarks.err + landmarks.out
    assert [secret for secret in (PASSWORD, IN_URL) if secret in shown] == []


SHOWING = pytest.mark.parametrize("words", [("config", "show"), ("config", "show", "--json"), ("config", "check")])


@SHOWING
def test_a_configuration_is_shown_without_the_content_of_its_files(fleet: SecuredFleet, words: tuple[str, ...]) -> None:
    run = trigpoint(*words, "--config", fleet.fleet.config)
    assert run.status == 0, run.err
    assert [secret for secret in (PASSWORD, key_text(fleet, "services")) if secret in run.out + run.err] == []


@SHOWING
def test_a_password_in_the_environment_is_masked(words: tuple[str, ...], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TRIGPOINT_DATABASE__URL", f"postgresql+psycopg://trigpoint:{IN_URL}@127.0.0.1/trigpoint")
    run = trigpoint(*words, "--set", "fleet.data=data")
    assert run.status == 0, run.err
    assert [secret for secret in (PASSWORD, IN_URL) if secret in run.out + run.err] == []


def test_a_password_in_a_flag_is_refused_and_not_repeated() -> None:
    url = f"database.url=postgresql+psycopg://trigpoint:{IN_URL}@127.0.0.1/trigpoint"
    run = trigpoint("config", "show", "--set", "fleet.data=data", "--set", url)
    assert (run.status, IN_URL in run.out + run.err) == (2, False)


def test_a_wrong_passphrase_is_not_repeated(tmp_path: Path) -> None:
    secret = tmp_path / "passphrase"
    secret.write_text("the right passphrase", encoding="utf-8")
    assert trigpoint("certs", "init", tmp_path / "authority", "--passphrase-file", secret).status == 0
    secret.write_text("not the right one", encoding="utf-8")
    words = ("certs", "issue", "veh-a", "--role", "vehicle", "--authority", tmp_path / "authority")
    run = trigpoint(*words, "--passphrase-file", secret, "--debug")
    assert (run.status, "not the right one" in run.out + run.err) == (2, False)


def test_processes_answer_http_on_loopback_only(fleet: SecuredFleet) -> None:
    with trigpoint_process(fleet.folder, "router", "--config", fleet.fleet.config):
        fleet.fleet.wait_ready("router")
        assert listening_addresses(fleet.fleet.ports["router"]) == {"0100007F"}


def listening_addresses(port: int) -> set[str]:
    """The local addresses, as the kernel writes them, at which somebody listens on a port."""
    rows = [line.split() for name in ("tcp", "tcp6") for line in Path(f"/proc/net/{name}").read_text().splitlines()[1:]]
    return {row[1].partition(":")[0] for row in rows if row[3] == "0A" and int(row[1].rpartition(":")[2], 16) == port}
