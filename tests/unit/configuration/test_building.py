"""Settings from layers: which value wins, and what is said of those that cannot be."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

import pytest

from trigpoint.configuration.building import ConfigurationRefused, Configured, configured
from trigpoint.configuration.given import from_environment, from_flags, from_toml
from trigpoint.configuration.limits import Count, Port, Seconds, SetElsewhere
from trigpoint.errors import InputError


@dataclass(frozen=True, slots=True, kw_only=True)
class Inner:
    gate_sigmas: float = 3.0
    count: Count = 5


@dataclass(frozen=True, slots=True, kw_only=True)
class Net:
    port: Port = 80
    hosts: tuple[str, ...] = ()
    mode: Literal["peer", "client"] = "peer"
    name: str = "n"
    on: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Work:
    folder: Path
    wait_s: Seconds = 1.0
    root: str = "r"
    vehicles: frozenset[str] | None = None
    inner: Inner = field(default_factory=lambda: Inner(gate_sigmas=4.0))
    more: Inner | None = None

    def __post_init__(self) -> None:
        if self.wait_s == 13.0:
            raise InputError("wait_s = 13: brings bad luck")


@dataclass(frozen=True, slots=True, kw_only=True)
class Tree:
    net: Net = field(default_factory=Net)
    work: Annotated[Work, SetElsewhere((("root", "net.name"),))]


def settings_of(tmp_path: Path, toml: str, *flags: str, **environment: str) -> Configured[Tree]:
    path = tmp_path / "t.toml"
    path.write_text(toml, encoding="utf-8")
    return configured(Tree, [from_toml(path), from_environment(environment), from_flags(flags)])


def refused(tmp_path: Path, toml: str, *flags: str, **environment: str) -> tuple[str, ...]:
    with pytest.raises(ConfigurationRefused) as caught:
        settings_of(tmp_path, toml, *flags, **environment)
    return caught.value.complaints


FOLDER = '[work]\nfolder = "/f"\n'


def test_a_flag_goes_before_the_environment_and_that_before_the_file(tmp_path: Path) -> None:
    toml = FOLDER + "wait_s = 2\n[net]\nport = 1\nname = 'file'\n"
    found = settings_of(tmp_path, toml, "net.port=3", TRIGPOINT_NET__PORT="2", TRIGPOINT_NET__NAME="variable")
    assert (found.settings.net.port, found.settings.net.name, found.settings.work.wait_s) == (3, "variable", 2.0)


def test_a_value_knows_where_it_was_given(tmp_path: Path) -> None:
    found = settings_of(tmp_path, FOLDER, "net.port=3", TRIGPOINT_NET__NAME="x")
    origins = {".".join(path): given.origin for path, given in found.given.items()}
    assert origins == {
        "work.folder": str(tmp_path / "t.toml"),
        "net.name": "environment TRIGPOINT_NET__NAME",
        "net.port": "flag --set",
    }


def test_a_table_keeps_its_own_default_where_one_key_of_it_is_set(tmp_path: Path) -> None:
    found = settings_of(tmp_path, FOLDER + "[work.inner]\ncount = 7\n")
    assert found.settings.work.inner == Inner(gate_sigmas=4.0, count=7)


def test_a_table_that_need_not_be_there_is_there_once_a_key_of_it_is(tmp_path: Path) -> None:
    assert settings_of(tmp_path, FOLDER).settings.work.more is None
    assert settings_of(tmp_path, FOLDER, "work.more.count=2").settings.work.more == Inner(count=2)


@pytest.mark.parametrize(
    ("text", "hosts"),
    [("", ()), ("a", ("a",)), ("tcp/a:1, tcp/b:2", ("tcp/a:1", "tcp/b:2")), ('["a,b"]', ("a,b",))],
)
def test_a_list_from_outside_is_parted_by_commas_or_written_as_toml(
    tmp_path: Path, text: str, hosts: tuple[str, ...]
) -> None:
    assert settings_of(tmp_path, FOLDER, TRIGPOINT_NET__HOSTS=text).settings.net.hosts == hosts


@pytest.mark.parametrize(("text", "on"), [("true", True), ("false", False), ("1", True)])
def test_a_switch_from_outside_is_read_as_one(tmp_path: Path, text: str, on: bool) -> None:
    assert settings_of(tmp_path, FOLDER, f"net.on={text}").settings.net.on is on


def test_text_that_looks_like_a_number_stays_text_where_the_key_holds_text(tmp_path: Path) -> None:
    assert settings_of(tmp_path, FOLDER, "net.name=12").settings.net.name == "12"


def test_a_key_that_another_section_sets_takes_its_value_and_cannot_be_set_itself(tmp_path: Path) -> None:
    assert settings_of(tmp_path, FOLDER, "net.name=fleet").settings.work.root == "fleet"
    assert refused(tmp_path, FOLDER, "work.root=x") == ("[work] root: [net] name sets it (flag --set)",)


def test_a_value_beyond_its_limit_is_named_with_key_value_limit_and_origin(tmp_path: Path) -> None:
    path = tmp_path / "t.toml"
    (line,) = refused(tmp_path, FOLDER + "[net]\nport = 65536\n")
    assert line == f"[net] port = 65536: should be less than or equal to 65535 ({path})"


def test_a_file_gives_a_number_as_a_number(tmp_path: Path) -> None:
    (line,) = refused(tmp_path, FOLDER + '[net]\nport = "80"\n')
    assert "[net] port = '80': should be a valid integer" in line


@pytest.mark.parametrize("value", ["inf", "nan", "0.0", "-1.0", "2020-01-01"])
def test_a_duration_is_a_finite_number_above_zero(tmp_path: Path, value: str) -> None:
    (line,) = refused(tmp_path, f"{FOLDER}wait_s = {value}\n")
    assert line.startswith("[work] wait_s = ")


def test_an_unknown_key_is_refused_with_the_nearest_known_one(tmp_path: Path) -> None:
    assert refused(tmp_path, FOLDER, "net.prt=1") == ("[net] has no key prt, but port (flag --set)",)
    assert refused(tmp_path, FOLDER, "nett.port=1") == ("no section [nett], but net (flag --set)",)
    (line,) = refused(tmp_path, FOLDER + "[work.iner]\ncount = 1\n")
    assert "[work] has no key iner.count, but inner.count" in line


def test_a_key_without_a_default_has_to_be_set(tmp_path: Path) -> None:
    assert refused(tmp_path, "") == ("[work] folder: has to be set",)


def test_everything_that_is_wrong_is_said_at_once(tmp_path: Path) -> None:
    assert len(refused(tmp_path, FOLDER, "net.port=-1", "net.mode=router", "work.inner.count=0", "a.b=1")) == 4


def test_what_the_class_itself_refuses_is_said_with_its_section(tmp_path: Path) -> None:
    assert refused(tmp_path, FOLDER, "work.wait_s=13") == ("[work] wait_s = 13: brings bad luck",)


def test_a_password_in_a_value_that_is_refused_is_not_said(tmp_path: Path) -> None:
    (line,) = refused(tmp_path, FOLDER, TRIGPOINT_NET__MODE="postgresql://me:geheim@host/db")
    assert "geheim" not in line
    assert "me:***@host" in line


def test_a_password_in_a_flag_is_refused_without_being_said() -> None:
    with pytest.raises(InputError, match="process list") as caught:
        from_flags(["database.url=postgresql://me:geheim@host/db"])
    assert "geheim" not in str(caught.value)


@pytest.mark.parametrize("word", ["net.port", "port=1", "=1"])
def test_a_flag_of_another_form_is_refused(word: str) -> None:
    with pytest.raises(InputError, match=r"SECTION\.KEY=VALUE"):
        from_flags([word])


def test_a_variable_that_names_no_section_is_not_ours() -> None:
    assert from_environment({"TRIGPOINT_HOME": "x", "PATH": "y", "OTHER__KEY": "z"}) == {}


@pytest.mark.parametrize("content", [b"[net\n", b"\xff\xfe", b"a = 1\na = 2\n"])
def test_a_file_that_is_no_toml_is_named(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "bad.toml"
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"bad\.toml: no TOML"):
        from_toml(path)


def test_a_file_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"none\.toml: no configuration can be read here: No such file"):
        from_toml(tmp_path / "none.toml")


def test_a_key_outside_of_a_section_is_refused(tmp_path: Path) -> None:
    (line,) = refused(tmp_path, "port = 1\n" + FOLDER)
    assert line.startswith("port: stands in no section")


@pytest.mark.parametrize("number", ["-1", "inf", "nan", "-inf"])
def test_a_number_without_a_limit_of_its_own_is_finite_and_not_negative(tmp_path: Path, number: str) -> None:
    expected = f"[work] inner.gate_sigmas = '{number}': should be a finite number of at least 0 (flag --set)"
    assert refused(tmp_path, FOLDER, f"work.inner.gate_sigmas={number}") == (expected,)
