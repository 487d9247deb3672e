"""The API's definition (OpenAPI 3.0): what the framework knows of the corrections, and all that is read."""

from collections.abc import Sequence
from typing import Any

from trigpoint.landmarks.feature_query import PAGE_MOST
from trigpoint.landmarks.layers import Layer
from trigpoint.landmarks.tile_grid import ZOOM_MOST
from trigpoint_landmarks.http.documents import DESCRIPTION, GEOJSON, JSON, MVT, QUADS, SCHEMA_JSON, TITLE, JsonObject
from trigpoint_landmarks.http.openapi_parts import (
    AS_OF,
    JSON_ONLY,
    WHOLE,
    WRITE_PROBLEMS,
    getting,
    object_with,
    path_part,
    problems_of,
    query,
    responses,
)
from trigpoint_landmarks.http.openapi_viewer import viewer_paths
from trigpoint_landmarks.http.page_parameters import PAGE_DEFAULT

REPLACED = ("HTTPValidationError", "ValidationError")  # a body that is not as it has to be is a problem like any other
URI: JsonObject = {"type": "string", "format": "uri"}
CRS = query("crs", "The coordinates' reference system, by its URI", URI)
NUMBERS: JsonObject = {
    "type": "array",
    "oneOf": [{"minItems": 4, "maxItems": 4}, {"minItems": 6, "maxItems": 6}],
    "items": {"type": "number"},
}
PAGE_PARAMETERS = (
    {**query("bbox", "Features that meet this box", NUMBERS), "style": "form", "explode": False},
    query("bbox-crs", "The box's reference system", URI),
    CRS,
    query("datetime", "Features whose own span meets this instant or interval", {"type": "string"}),
    query(
        "limit",
        "At most so many",
        {"type": "integer", "minimum": 1, "maximum": PAGE_MOST, "default": PAGE_DEFAULT},
    ),
    query("filter", "Features that meet this CQL2 expression", {"type": "string"}),
    query(
        "filter-lang",
        "The language it is in",
        {"type": "string", "enum": ["cql2-text", "cql2-json"], "default": "cql2-text"},
    ),
    query("filter-crs", "The reference system of the geometries in it", URI),
    AS_OF,
    query("from", "The first feature of the page, as a `next` link has it", {"type": "string"}),
    query("f", "The form of the answer", {"type": "string", "enum": ["json", "geojson"]}),
)
TILE_PATH = {
    "z": path_part("z", "Zoom", {**WHOLE, "maximum": ZOOM_MOST}),
    "x": path_part("x", "Column", WHOLE),
    "y": path_part("y", "Row", WHOLE),
}


def _tile_responses() -> JsonObject:
    binary = {"type": "string", "format": "binary"}
    return {
        **responses(MVT, binary),
        "204": {"description": "Nothing is in the tile"},
        "304": {"description": "It is as the client has it"},
    }


def _of_layer(layer: Layer) -> JsonObject:
    """The paths of one collection."""
    own, name = f"/collections/{layer.name}", layer.name
    own_properties = [
        query(one.name, one.description, {"type": one.kind}) for one in layer.properties if one.comparable
    ]
    feature_id = path_part("feature_id", "The feature's id", {"type": "string", "minLength": 1})
    page = responses(GEOJSON, {"$ref": "#/components/schemas/FeatureCollection"})
    one = responses(GEOJSON, {"$ref": "#/components/schemas/Feature"})
    about = responses(JSON, {"$ref": "#/components/schemas/Collection"})
    schema = responses(SCHEMA_JSON, object_with("type", "properties"))
    paths = {
        own: getting(f"describe_{name}", layer.title, about, JSON_ONLY, tag=name),
        f"{own}/queryables": getting(f"queryables_of_{name}", "What is queryable", schema, JSON_ONLY, tag=name),
        f"{own}/items": getting(f"items_of_{name}", "A page", page, *PAGE_PARAMETERS, *own_properties, tag=name),
        f"{own}/items/{{feature_id}}": getting(
            f"item_of_{name}", "One feature", one, feature_id, CRS, AS_OF, JSON_ONLY, tag=name
        ),
    }
    return {**paths, **(_tiles_of(layer) if layer.tiled else {})}


def _tiles_of(layer: Layer) -> JsonObject:
    own, name = f"/collections/{layer.name}/tiles", layer.name
    version = path_part("version", "The map version", {"type": "integer", "minimum": 1})
    matrix = [
        path_part("tileMatrix", "Zoom", {**WHOLE, "maximum": ZOOM_MOST}),
        path_part("tileRow", "Row", WHOLE),
        path_part("tileCol", "Column", WHOLE),
    ]
    plain = list(TILE_PATH.values())
    tilesets, tileset = responses(JSON, object_with("tilesets")), responses(JSON, object_with("links", "crs"))
    tile = _tile_responses()
    return {
        own: getting(f"tilesets_of_{name}", "The tile sets", tilesets, JSON_ONLY, tag=name),
        f"{own}/{QUADS}": getting(f"tileset_of_{name}", "The tile set", tileset, JSON_ONLY, tag=name),
        f"{own}/{QUADS}/{{tileMatrix}}/{{tileRow}}/{{tileCol}}": getting(
            f"ogc_tile_of_{name}", "A tile", tile, *matrix, AS_OF, tag=name
        ),
        f"/tiles/{name}.json": getting(
            f"tilejson_of_{name}", "TileJSON", responses(JSON, object_with("tilejson", "tiles")), AS_OF, tag=name
        ),
        f"/tiles/{name}/{{z}}/{{x}}/{{y}}": getting(f"tile_of_{name}", "A tile", tile, *plain, AS_OF, tag=name),
        f"/v/{{version}}/tiles/{name}/{{z}}/{{x}}/{{y}}": getting(
            f"tile_of_a_version_of_{name}", "A tile that never changes", tile, version, *plain, tag=name
        ),
    }


def _of_map() -> JsonObject:
    either = query("f", "The form of the answer", {"type": "string", "enum": ["json", "html"]})
    landing = responses(JSON, object_with("links"))
    landing["200"]["content"]["text/html"] = {"schema": {"type": "string"}}
    return {
        "/": getting("landing_page", "The landing page", landing, either),
        "/conformance": getting(
            "conformance", "What it conforms to", responses(JSON, object_with("conformsTo")), JSON_ONLY
        ),
        "/collections": getting(
            "collections", "All collections", responses(JSON, object_with("links", "collections")), JSON_ONLY
        ),
        "/versions": getting("versions", "All map versions", responses(JSON, object_with("versions")), JSON_ONLY),
        "/tileMatrixSets": getting(
            "tile_matrix_sets", "The tile matrix sets", responses(JSON, object_with("tileMatrixSets")), JSON_ONLY
        ),
        f"/tileMatrixSets/{QUADS}": getting(
            "tile_matrix_set", QUADS, responses(JSON, object_with("tileMatrices")), JSON_ONLY
        ),
    }


LINKS: JsonObject = {"type": "array", "items": {"$ref": "#/components/schemas/Link"}}
VERSION: JsonObject = {"type": "integer"}


def _schemas() -> JsonObject:
    return {
        "Problem": {**object_with("type", "title", "status", "detail"), "properties": {"status": {"type": "integer"}}},
        "Link": {**object_with("href", "rel"), "properties": {"href": {"type": "string"}, "rel": {"type": "string"}}},
        "Collection": {
            **object_with("id", "links", "crs", "storageCrs"),
            "properties": {"id": {"type": "string"}, "links": LINKS},
        },
        "Feature": _feature_schema(),
        "FeatureCollection": {
            **object_with("type", "features", "links", "numberReturned"),
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
        **object_with("type", "id", "geometry", "properties"),
        "properties": {
            "type": {"type": "string", "enum": ["Feature"]},
            "id": {"type": "string"},
            "geometry": {**object_with("type", "coordinates"), "nullable": True},
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
    paths |= viewer_paths()
    paths["/api"] = getting(
        "api", "This document", responses("application/vnd.oai.openapi+json", object_with("openapi"))
    )
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
            method: {**operation, "responses": {**operation["responses"], **problems_of(WRITE_PROBLEMS)}}
            for method, operation in operations.items()
        }
        for path, operations in paths.items()
    }
