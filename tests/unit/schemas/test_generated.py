import pytest

from trigpoint_schemas.generate import main, proto_files, stale_files


def test_the_generated_code_is_what_the_schemas_say() -> None:
    assert stale_files() == ()


def test_there_is_one_schema_file_for_each_module_of_events_and_one_for_questions() -> None:
    names = {path.stem for path in proto_files()}
    assert names - {"asked"} == {"observed", "corrected", "estimated", "perceived", "mapped"}


def test_check_ends_with_status_0_when_nothing_is_stale() -> None:
    assert main(["--check"]) == 0


def test_an_unknown_argument_is_bad_usage_and_writes_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--chekc"]) == 2
    assert "--chekc: only --check is known" in capsys.readouterr().err
