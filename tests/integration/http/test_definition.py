"""The service keeps to its own definition, whatever it is asked: requests made up from it by Schemathesis."""

import json
from collections.abc import Iterator
from contextlib import closing
from typing import Any

import pytest
import schemathesis
from hypothesis import HealthCheck, given, settings, strategies
from schemathesis import GenerationMode
from schemathesis.checks import not_a_server_error
from schemathesis.core.result import Ok
from schemathesis.specs.openapi.checks import (
    content_type_conformance,
    response_headers_conformance,
    response_schema_conformance,
    status_code_conformance,
)

from landmark_maps.examples import checkpoint, pin_frame
from map_features.examples import two_versions
from map_http.asking import issued
from map_http.served import geopackage_line, served_map
from trigpoint.landmarks.geopackage_store import GeoPackageStore
from trigpoint.landmarks.layers import LAYERS
from trigpoint.logs.mcap_log import McapLog
from trigpoint_landmarks.http.application import corrections_definition
from trigpoint_landmarks.http.openapi import api_document
from trigpoint_landmarks.http.tokens import Scope

CHECKS = [
    not_a_server_error,
    status_code_conformance,
    content_type_conformance,
    response_headers_conformance,
    response_schema_conformance,
]
DEFINITION = schemathesis.openapi.from_dict(
    api_document(corrections_definition(), tuple(LAYERS.values()), base_url="http://127.0.0.1")
)
OPERATIONS = {found.ok().label: found.ok() for found in DEFINITION.get_all_operations() if isinstance(found, Ok)}
OPERATIONS.pop("GET /events")  # has no end: tests/contract/http has its own for it
BOTH = [GenerationMode.POSITIVE, GenerationMode.NEGATIVE]
SHORT, LONG = 6, 100  # requests of an operation


@pytest.fixture(scope="module")
def asked(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[str, dict[str, str]]]:
    """Where the service is, and a header that lets everything through."""
    folder = tmp_path_factory.mktemp("definition")
    tokens, headers = issued(folder, Scope.ADMINISTER)
    path = folder / "map.gpkg"
    with closing(GeoPackageStore(path)) as store:
        for number, change in enumerate(two_versions()):
            store.apply(change, checkpoint(number + 1))
    with closing(McapLog(folder / "log")) as log:
        pin_frame(log)
    web = f"token_file = {json.dumps(str(tokens))}\nrate_hz = 1e6\nburst = 1000000"
    with served_map(folder, database=geopackage_line(path), web=web) as served:
        yield served.url, headers[Scope.ADMINISTER]


def keeps_to_the_definition(label: str, asked: tuple[str, dict[str, str]], *, examples: int) -> None:
    """Asks so many made-up requests of an operation, fit and unfit ones."""
    url, headers = asked

    @settings(
        max_examples=examples,
        deadline=None,
        derandomize=True,
        database=None,
        suppress_health_check=list(HealthCheck),
    )
    @given(mode=strategies.sampled_from(BOTH), data=strategies.data())
    def each(mode: GenerationMode, data: Any) -> None:
        case = data.draw(OPERATIONS[label].as_strategy(generation_mode=mode))
        answer = case.call(base_url=url, headers=headers)
        case.validate_response(answer, checks=CHECKS)

    each()


@pytest.mark.parametrize("label", OPERATIONS)
def test_an_operation_keeps_to_its_definition(label: str, asked: tuple[str, dict[str, str]]) -> None:
    keeps_to_the_definition(label, asked, examples=SHORT)


@pytest.mark.slow
@pytest.mark.parametrize("label", OPERATIONS)
def test_an_operation_keeps_to_its_definition_for_long(label: str, asked: tuple[str, dict[str, str]]) -> None:
    keeps_to_the_definition(label, asked, examples=LONG)
