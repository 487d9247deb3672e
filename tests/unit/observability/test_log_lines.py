"""What is logged, and what never is."""

import io
import json
import logging
from typing import Any

import pytest

from trigpoint.observability.log_lines import LineFormatter, Secrets

RECORD = {"name": "trigpoint.x", "levelno": logging.WARNING, "levelname": "WARNING", "created": 0.25}


def line(record: dict[str, Any], *, form: Any = "json", secrets: Secrets | None = None) -> str:
    formatter = LineFormatter("ingest", form=form, secrets=secrets or Secrets())
    return formatter.format(logging.makeLogRecord({**RECORD, **record}))


def test_a_record_is_one_json_object_on_one_line() -> None:
    logged = line({"msg": "%d rows\nlost", "args": (3,), "vehicle": "veh-a", "lag_s": 0.5})
    assert "\n" not in logged
    assert json.loads(logged) == {
        "time": "1970-01-01T00:00:00.250+00:00",
        "level": "WARNING",
        "service": "ingest",
        "logger": "trigpoint.x",
        "message": "3 rows\nlost",
        "vehicle": "veh-a",
        "lag_s": 0.5,
    }


def test_a_number_that_json_does_not_have_is_logged_as_text() -> None:
    assert json.loads(line({"msg": "solved", "sigma_m": float("nan")}), parse_constant=pytest.fail)["sigma_m"] == "nan"


def test_a_plain_record_is_one_line_with_what_came_along() -> None:
    logged = line({"msg": "rows\nlost", "vehicle": "veh-a"}, form="plain")
    assert logged == "1970-01-01T00:00:00.250+00:00 WARNING ingest trigpoint.x: rows lost vehicle=veh-a"


def test_a_secret_is_masked_wherever_it_stands() -> None:
    secrets = Secrets()
    secrets.add("geheim")
    logged = line({"msg": "password %s refused", "args": ("geheim",), "answer": {"was": "geheim"}}, secrets=secrets)
    assert "geheim" not in logged
    assert "password *** refused" in logged


def test_a_password_in_a_url_is_masked_though_nobody_named_it() -> None:
    assert "pw" not in line({"msg": "connecting to postgresql://me:pw@host/db"})


def test_a_secret_in_a_traceback_is_masked() -> None:
    secrets = Secrets()
    secrets.add("geheim")
    stream = io.StringIO()
    handler = logging.StreamHandler(stream)
    handler.setFormatter(LineFormatter("ingest", form="json", secrets=secrets))
    logger = logging.Logger("test")
    logger.addHandler(handler)
    try:
        raise ValueError("geheim")
    except ValueError:
        logger.exception("failed")
    assert "ValueError: ***" in json.loads(stream.getvalue())["traceback"]


def test_a_secret_too_short_to_be_one_does_not_mask_every_line() -> None:
    secrets = Secrets()
    secrets.add("a")
    assert secrets.masked("a map") == "a map"


def test_a_plain_record_sends_no_control_characters_to_a_terminal() -> None:
    assert line({"msg": "vehicle \x1b[2J"}, form="plain").endswith("vehicle ?[2J")


def test_a_list_stays_one() -> None:
    assert json.loads(line({"msg": "x", "running": ["a", "b"]}))["running"] == ["a", "b"]
