"""Parts of the API's definition (OpenAPI 3.0): parameters, answers, problems, operations."""

from collections.abc import Sequence

from trigpoint_landmarks.http.documents import JsonObject
from trigpoint_landmarks.http.problems import PROBLEM_JSON

READ_PROBLEMS = ("400", "401", "403", "404", "405", "406", "429", "500", "503")
WRITE_PROBLEMS = (*READ_PROBLEMS, "408", "413", "422")
DESCRIPTIONS = {
    "400": "A parameter cannot be",
    "401": "A token is needed",
    "403": "The token's scope is not enough",
    "404": "There is no such thing",
    "405": "Not this method",
    "406": "Not in this form",
    "408": "The body came too slowly",
    "413": "The body is too large",
    "422": "The body is not as it has to be",
    "429": "Too many requests",
    "500": "Something failed",
    "503": "The database is away",
}


def query(name: str, description: str, schema: JsonObject) -> JsonObject:
    """A parameter of a query, which may be left out."""
    return {"name": name, "in": "query", "description": description, "required": False, "schema": schema}


def path_part(name: str, description: str, schema: JsonObject) -> JsonObject:
    """A part of a path."""
    return {"name": name, "in": "path", "description": description, "required": True, "schema": schema}


WHOLE: JsonObject = {"type": "integer", "minimum": 0}
AS_OF = query("as_of", "The map version, the newest by default", {"type": "integer", "minimum": 1})
JSON_ONLY = query("f", "The form of the answer", {"type": "string", "enum": ["json"]})


def responses(content: str, schema: JsonObject, *, problems: Sequence[str] = READ_PROBLEMS) -> JsonObject:
    """An answer of one kind, or a problem."""
    return {"200": {"description": "As asked for", "content": {content: {"schema": schema}}}, **problems_of(problems)}


def problems_of(statuses: Sequence[str]) -> JsonObject:
    """The problems of these statuses."""
    problem = {PROBLEM_JSON: {"schema": {"$ref": "#/components/schemas/Problem"}}}
    return {status: {"description": DESCRIPTIONS[status], "content": problem} for status in statuses}


def getting(name: str, summary: str, answers: JsonObject, *parameters: JsonObject, tag: str = "map") -> JsonObject:
    """The operation of a path that is read."""
    operation = {"operationId": name, "summary": summary, "tags": [tag], "responses": answers}
    return {"get": {**operation, **({"parameters": list(parameters)} if parameters else {})}}


def object_with(*required: str) -> JsonObject:
    """An object that has these names at least."""
    return {"type": "object", "required": list(required)}
