"""The table of data flows, the folders, the services' docstrings and the README say the same."""

import ast
import inspect
import re
from collections import Counter
from pathlib import Path
from types import ModuleType

import pytest

from trigpoint import dataflow
from trigpoint.bus import access
from trigpoint.bus.key_expressions import key_matches
from trigpoint.events import corrected, estimated, keys, mapped, observed, perceived, scanned
from trigpoint_schemas.v1 import asked_pb2

REPOSITORY = Path(__file__).parents[2]
SERVICES = sorted(path.name for path in (REPOSITORY / "services").iterdir() if path.is_dir())
PARTS_OF_EVENTS = {  # values inside an event
    observed.LandmarkDetection,
    perceived.PerceivedLandmark,
    perceived.RefusedLoops,
    perceived.SoughtDrive,
}


def declared(service: str, heading: str) -> set[str]:
    """The event names after `Reads:` or `Writes:` in a service's docstring, up to the next heading."""
    source = (REPOSITORY / "services" / service / "__init__.py").read_text(encoding="utf-8")
    docstring = ast.get_docstring(ast.parse(source)) or ""
    found = re.search(rf"^{heading}:(.*?)(?=^\w+:|\Z)", docstring, re.MULTILINE | re.DOTALL)
    assert found, f"{service} has no line {heading!r} in its docstring"
    return set(re.findall(r"\b[A-Z][a-z]+(?:[A-Z][a-z]+)+\b", found.group(1)))


def events_of(module: ModuleType) -> set[type]:
    classes = {kind for _, kind in inspect.getmembers(module, inspect.isclass) if kind.__module__ == module.__name__}
    return classes - PARTS_OF_EVENTS


def test_every_folder_of_services_is_in_the_table() -> None:
    assert tuple(name for name in SERVICES if name != "__pycache__") == dataflow.services()


@pytest.mark.parametrize("service", dataflow.services())
def test_a_service_says_that_it_reads_what_the_table_says(service: str) -> None:
    assert sorted(declared(service, "Reads")) == list(dataflow.events_read_by(service))


@pytest.mark.parametrize("service", dataflow.services())
def test_a_service_says_that_it_writes_what_the_table_says(service: str) -> None:
    assert sorted(declared(service, "Writes")) == list(dataflow.events_written_by(service))


def test_an_event_has_one_writer() -> None:
    rows = Counter(flow.event for flow in dataflow.FLOWS)
    assert [event.__name__ for event, count in rows.items() if count > 1] == []


def test_a_stream_has_one_writer() -> None:
    writers = Counter(stream for stream, _ in {(flow.stream, flow.writer) for flow in dataflow.FLOWS})
    assert [stream for stream, count in writers.items() if count > 1] == []


def test_every_event_class_is_in_the_table() -> None:
    classes = set().union(
        *(events_of(module) for module in (observed, scanned, corrected, estimated, perceived, mapped))
    )
    assert classes == {flow.event for flow in dataflow.FLOWS}


def test_every_event_has_a_key_and_a_stream_and_no_two_share_a_key() -> None:
    assert set(keys.KEY_PATTERNS) == set(keys.STREAM_PATTERNS) == {flow.event for flow in dataflow.FLOWS}
    assert len(set(keys.KEY_PATTERNS.values())) == len(keys.KEY_PATTERNS)


def test_the_readme_shows_the_diagram_of_the_table() -> None:
    text = (REPOSITORY / "README.md").read_text(encoding="utf-8")
    assert dataflow.text_with_diagram(text) == text, "run `make readme`"


def test_the_diagram_names_every_event_and_every_service() -> None:
    diagram = dataflow.mermaid_diagram()
    names = [flow.name for flow in dataflow.FLOWS] + [
        name.removeprefix("trigpoint_") for name in dataflow.services() if name != dataflow.CLI
    ]
    assert [name for name in names if name not in diagram] == []


def messages_of_questions() -> set[str]:
    """The messages that travel by themselves: those asked with, answered and told."""
    named = {notice.schema for notice in dataflow.NOTICES}
    return named | {schema for notice in dataflow.NOTICES for schema in notice.asked_with}


def test_every_notice_is_a_message_of_the_schemas() -> None:
    there = {f"trigpoint.v1.{name}" for name in asked_pb2.DESCRIPTOR.message_types_by_name}
    assert messages_of_questions() <= there


def test_no_notice_has_the_key_of_an_event() -> None:
    assert {notice.pattern for notice in dataflow.NOTICES} & set(keys.KEY_PATTERNS.values()) == set()


def test_a_notice_may_be_said_where_the_access_rules_let_its_writer() -> None:
    wild = {"map": "m", "zoom": "16", "column": "1", "row": "2", "question": "landmarks"}
    refused = [
        notice.schema
        for notice in dataflow.NOTICES
        if not any(
            key_matches(allowed, notice.pattern.format(**wild))
            for allowed in (access.ANSWERS.answer if notice.asked_with else access.LANDMARKS.publish)
        )
    ]
    assert refused == []
