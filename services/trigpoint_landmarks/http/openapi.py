"""The API's definition (OpenAPI 3.0): what the framework knows of the corrections, and all that is read."""

from collections.abc import Sequence
from typing import Any

from trigpoint.landmarks.feature_query import PAGE_MOST
from trigpoint.landmarks.layers import Layer
from trigpoint.landmarks.tile_grid import ZOOM_MOST
from trigpoint_landmarks.http.documents import DESCRIPTION, GEOJSON, JSON, MVT, QUADS, SCHEMA_JSON, TITLE, JsonObject
from trigpoint_landmarks.http.page_parameters import PAGE_DEFAULT
from trigpoint_landmarks.http.problems import PROBLEM_JSON

READ_PROBLEMS = ("400", "401", "403", "404", "405", "406", "429", "500", "503")
WRITE_PROBLEMS = (*READ_PROBLEMS, "408", "413", "422")
REPLACED = ("HTTPValidationError", "ValidationError")  # a body that is not as it has to be is a problem like any other
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


def _query(name: str, description: str, schema: JsonObject) -> JsonObject:
    return {"name": name, "in": "query", "description": description, "required": False, "schema": schema}


def _path(name: str, description: str, schema: JsonObject) -> JsonObject:
    return {"name": name, "in": "path", "description": description, "required": True, "schema": schema}


WHOLE: JsonObject = {"type": "integer", "minimum": 0}
URI: JsonObject = {"type": "string", "format": "uri"}
AS_OF = _query("as_of", "The map version, the newest by default", {"type": "integer", "minimum": 1})
JSON_ONLY = _query("f", "The form of the answer", {"type": "string", "enum": ["json"]})
CRS = _query("crs", "The coordinates' reference system, by its URI", URI)
NUMBERS: JsonObject = {
    "type": "array",
    "oneOf": [{"minItems": 4, "maxItems": 4}, {"minItems": 6, "maxItems": 6}],
    "items": {"type": "number"},
}
PAGE_PARAMETERS = (
    {**_query("bbox", "Features that meet this box", NUMBERS), "style": "form", "explode": False},
    _query("bbox-crs", "The box's reference system", URI),
    CRS,
    _query("datetime", "Features whose own span meets this instant or interval", {"type": "string"}),
    _query(
        "limit",
        "At most so many",
        {"type": "integer", "minimum": 1, "maximum": PAGE_MOST, "default": PAGE_DEFAULT},
    ),
    _query("filter", "Features that meet this CQL2 expression", {"type": "string"}),
    _query(
        "filter-lang",
        "The language it is in",
        {"type": "string", "enum": ["cql2-text", "cql2-json"], "default": "cql2-text"},
    ),
    _query("filter-crs", "The reference system of the geometries in it", URI),
    AS_OF,
    _query("from", "The first feature of the page, as a `next` link has it", {"type": "string"}),
    _query("f", "The form of the answer", {"type": "string", "enum": ["json", "geojson"]}),
)
TILE_PATH = {
    "z": _path("z", "Zoom", {**WHOLE, "maximum": ZOOM_MOST}),
    "x": _path("x", "Column", WHOLE),
    "y": _path("y", "Row", WHOLE),
}


def _responses(content: str, schema: JsonObject, *, problems: Sequence[str] = READ_PROBLEMS) -> JsonObject:
    return {"200": {"description": "As asked for", "content": {content: {"schema": schema}}}, **_problems(problems)}


def _problems(statuses: Sequence[str]) -> JsonObject:
    problem = {PROBLEM_JSON: {"schema": {"$ref": "#/components/schemas/Problem"}}}
    return {status: {"description": DESCRIPTIONS[status], "content": problem} for status in statuses}


def _get(name: str, summary: str, responses: JsonObject, *parameters: JsonObject, tag: str = "map") -> JsonObject:
    operation = {"operationId": name, "summary": summary, "tags": [tag], "responses": responses}
    return {"get": {**operation, **({"parameters": list(parameters)} if parameters else {})}}


def _object(*required: str) -> JsonObject:
    return {"type": "object", "required": list(required)}


def _tile_responses() -> JsonObject:
    binary = {"type": "string", "format": "binary"}
    return {
        **_responses(MVT, binary),
        "204": {"description": "Nothing is in the tile"},
        "304": {"description": "It is as the client has it"},
    }


def _of_layer(layer: Layer) -> JsonObject:
    """The paths of one collection."""
    own, name = f"/collections/{layer.name}", layer.name
    own_properties = [
        _query(one.name, one.description, {"type": one.kind}) for one in layer.properties if one.comparable
    ]
    feature_id = _path("feature_id", "The feature's id", {"type": "string", "minLength": 1})
    page = _responses(GEOJSON, {"$ref": "#/components/schemas/FeatureCollection"})
    one = _responses(GEOJSON, {"$ref": "#/components/schemas/Feature"})
    about = _responses(JSON, {"$ref": "#/components/schemas/Collection"})
    schema = _responses(SCHEMA_JSON, _object("type", "properties"))
    paths = {
        own: _get(f"describe_{name}", layer.title, about, JSON_ONLY, tag=name),
        f"{own}/queryables": _get(f"queryables_of_{name}", "What is queryable", schema, JSON_ONLY, tag=name),
        f"{own}/items": _get(f"items_of_{name}", "A page", page, *PAGE_PARAMETERS, *own_properties, tag=name),
        f"{own}/items/{{feature_id}}": _get(
            f"item_of_{name}", "One feature", one, feature_id, CRS, AS_OF, JSON_ONLY, tag=name
        ),
    }
    return {**paths, **(_tiles_of(layer) if layer.tiled else {})}


def _tiles_of(layer: Layer) -> JsonObject:
    own, name = f"/collections/{layer.name}/tiles", layer.name
    version = _path("version", "The map version", {"type": "integer", "minimum": 1})
    matrix = [
        _path("tileMatrix", "Zoom", {**WHOLE, "maximum": ZOOM_MOST}),
        _path("tileRow", "Row", WHOLE),
        _path("tileCol", "Column", WHOLE),
    ]
    plain = list(TILE_PATH.values())
    tilesets, tileset = _responses(JSON, _object("tilesets")), _responses(JSON, _object("links", "crs"))
    tile = _tile_responses()
    return {
        own: _get(f"tilesets_of_{name}", "The tile sets", tilesets, JSON_ONLY, tag=name),
        f"{own}/{QUADS}": _get(f"tileset_of_{name}", "The tile set", tileset, JSON_ONLY, tag=name),
        f"{own}/{QUADS}/{{tileMatrix}}/{{tileRow}}/{{tileCol}}": _get(
            f"ogc_tile_of_{name}", "A tile", tile, *matrix, AS_OF, tag=name
        ),
        f"/tiles/{name}.json": _get(
            f"tilejson_of_{name}", "TileJSON", _responses(JSON, _object("tilejson", "tiles")), AS_OF, tag=name
        ),
        f"/tiles/{name}/{{z}}/{{x}}/{{y}}": _get(f"tile_of_{name}", "A tile", tile, *plain, AS_OF, tag=name),
        f"/v/{{version}}/tiles/{name}/{{z}}/{{x}}/{{y}}": _get(
            f"tile_of_a_version_of_{name}", "A tile that never changes", tile, version, *plain, tag=name
        ),
    }


def _of_map() -> JsonObject:
    either = _query("f", "The form of the answer", {"type": "string", "enum": ["json", "html"]})
    landing = _responses(JSON, _object("links"))
    landing["200"]["content"]["text/html"] = {"schema": {"type": "string"}}
    return {
        "/": _get("landing_page", "The landing page", landing, either),
        "/conformance": _get("conformance", "What it conforms to", _responses(JSON, _object("conformsTo")), JSON_ONLY),
        "/collections": _get(
            "collections", "All collections", _responses(JSON, _object("links", "collections")), JSON_ONLY
        ),
        "/versions": _get("versions", "All map versions", _responses(JSON, _object("versions")), JSON_ONLY),
        "/tileMatrixSets": _get(
            "tile_matrix_sets", "The tile matrix sets", _responses(JSON, _object("tileMatrixSets")), JSON_ONLY
        ),
        f"/tileMatrixSets/{QUADS}": _get(
            "tile_matrix_set", QUADS, _responses(JSON, _object("tileMatrices")), JSON_ONLY
        ),
    }


LINKS: JsonObject = {"type": "array", "items": {"$ref": "#/components/schemas/Link"}}
VERSION: JsonObject = {"type": "integer"}


def _schemas() -> JsonObject:
    return {
        "Problem": {**_object("type", "title", "status", "detail"), "properties": {"status": {"type": "integer"}}},
        "Link": {**_object("href", "rel"), "properties": {"href": {"type": "string"}, "rel": {"type": "string"}}},
        "Collection": {
            **_object("id", "links", "crs", "storageCrs"),
            "properties": {"id": {"type": "string"}, "links": LINKS},
        },
        "Feature": _feature_schema(),
        "FeatureCollection": {
            **_object("type", "features", "links", "numberReturned"),
            "properties": {
                "type": {"type": "string", "enum": ["FeatureCollection"]},
                "map_version": VERSION,
                "numberReturned": WHOLE,
                "numberMatched": WHOLE,
                "links": LINKS,
                "features": {"type": "array", "items": {"$ref": "#/components/schemas/Feature"}},
            },
        },
    }


def _feature_schema() -> JsonObject:
    return {
        **_object("type", "id", "geometry", "properties"),
        "properties": {
            "type": {"type": "string", "enum": ["Feature"]},
            "id": {"type": "string"},
            "geometry": {**_object("type", "coordinates"), "nullable": True},
            "properties": {"type": "object"},
            "map_version": VERSION,
            "links": LINKS,
        },
    }


def api_document(corrections: Any, layers: Sequence[Layer], *, base_url: str) -> JsonObject:
    """The definition; `corrections`: what the framework made of the routes that write."""
    paths = {**_of_map()}
    for layer in layers:
        paths |= _of_layer(layer)
    paths["/api"] = _get("api", "This document", _responses("application/vnd.oai.openapi+json", _object("openapi")))
    made = corrections.get("components", {}).get("schemas", {})
    schemas = {**{name: one for name, one in made.items() if name not in REPLACED}, **_schemas()}
    return {
        "openapi": "3.0.3",
        "info": {"title": TITLE, "description": DESCRIPTION, "version": "1"},
        "servers": [{"url": base_url}],
        "paths": {**paths, **_with_problems(corrections.get("paths", {}))},
        "components": {
            "schemas": schemas,
            "securitySchemes": {"token": {"type": "http", "scheme": "bearer"}},
        },
        "security": [{}, {"token": []}],
    }


def _with_problems(paths: JsonObject) -> JsonObject:
    """The routes that write, each with the problems it may answer."""
    return {
        path.replace(":path}", "}"): {
            method: {**operation, "responses": {**operation["responses"], **_problems(WRITE_PROBLEMS)}}
            for method, operation in operations.items()
        }
        for path, operations in paths.items()
    }
