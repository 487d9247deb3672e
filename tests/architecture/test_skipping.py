"""Tests that continuous integration relies on cannot be skipped unseen."""

from pathlib import Path

import pytest

CONFTEST = Path(__file__).parents[1] / "conftest.py"
INI = "[pytest]\nmarkers =\n    browser: b\n    postgis: p\n    data: d\n"


@pytest.fixture
def suite(pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch) -> pytest.Pytester:
    monkeypatch.setenv("PYTEST_DISABLE_PLUGIN_AUTOLOAD", "1")  # others' plugins take seconds to load again
    pytester.makeconftest(CONFTEST.read_text(encoding="utf-8"))
    pytester.makefile(".ini", pytest=INI)
    return pytester


def test_a_skipped_test_of_a_forbidden_mark_fails_the_run(suite: pytest.Pytester) -> None:
    suite.makepyfile("import pytest\n@pytest.mark.browser\ndef test_page():\n    pytest.skip('no chromium')\n")
    result = suite.runpytest("--forbid-skipped=postgis", "--forbid-skipped=browser")
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(["*marked browser must not be*no chromium*"])


def test_a_skipped_test_of_another_mark_stays_skipped(suite: pytest.Pytester) -> None:
    suite.makepyfile("import pytest\n@pytest.mark.data\ndef test_drive():\n    pytest.skip('no drives')\n")
    suite.runpytest("--forbid-skipped=postgis").assert_outcomes(skipped=1)


def test_a_file_skipped_whole_fails_the_run(suite: pytest.Pytester) -> None:
    suite.makepyfile("import pytest\npytest.importorskip('absent_module')\n")
    suite.runpytest("--forbid-skipped=postgis").assert_outcomes(errors=1)


def test_without_the_option_skipping_is_allowed(suite: pytest.Pytester) -> None:
    suite.makepyfile("import pytest\n@pytest.mark.postgis\ndef test_rows():\n    pytest.skip('no database')\n")
    suite.runpytest().assert_outcomes(skipped=1)


def test_a_test_of_recorded_drives_says_where_it_looked_for_them(suite: pytest.Pytester) -> None:
    suite.makepyfile("import pytest\n@pytest.mark.data\ndef test_drive():\n    pass\n")
    result = suite.runpytest("-rs")
    result.assert_outcomes(skipped=1)
    result.stdout.fnmatch_lines(["*recorded drives are not at *shared/data*"])
