"""The API's own documents: landing page, conformance, collections, queryables, tile sets; plain values for JSON."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from datetime import UTC, datetime
from typing import Any

from trigpoint.geodesy.web_tiles import MERCATOR_LIMIT_DEG
from trigpoint.landmarks.cql2_conditions import GEOMETRY
from trigpoint.landmarks.feature_crs import CRS84_URI, offered_crs, storage_crs
from trigpoint.landmarks.feature_query import MapState, VersionSummary
from trigpoint.landmarks.layers import LANDMARKS, Layer, Property
from trigpoint.landmarks.tile_grid import EXTENT, TILE_PROPERTIES, ZOOM_MOST
from trigpoint_landmarks.http.asked import Asked

JsonObject = dict[str, Any]

TITLE = "trigpoint"
DESCRIPTION = "A landmark map in one geographic reference: landmarks with covariance, paths, anchors, drives."
GEOJSON, JSON, MVT = "application/geo+json", "application/json", "application/vnd.mapbox-vector-tile"
SCHEMA_JSON = "application/schema+json"
OPENAPI_JSON = "application/vnd.oai.openapi+json;version=3.0"
QUADS = "WebMercatorQuad"
QUADS_URI = f"http://www.opengis.net/def/tilematrixset/OGC/1.0/{QUADS}"
MERCATOR_URI = "http://www.opengis.net/def/crs/EPSG/0/3857"
REL = "http://www.opengis.net/def/rel/ogc/1.0"
SPEC = "http://www.opengis.net/spec"
CONFORMANCE = tuple(
    f"{SPEC}/{one}"
    for one in (
        "ogcapi-common-1/1.0/conf/core",
        "ogcapi-common-2/1.0/conf/collections",
        "ogcapi-features-1/1.0/conf/core",
        "ogcapi-features-1/1.0/conf/oas30",
        "ogcapi-features-1/1.0/conf/geojson",
        "ogcapi-features-2/1.0/conf/crs",
        "ogcapi-features-3/1.0/conf/queryables",
        "ogcapi-features-3/1.0/conf/queryables-query-parameters",
        "ogcapi-features-3/1.0/conf/filter",
        "ogcapi-features-3/1.0/conf/features-filter",
        "ogcapi-tiles-1/1.0/conf/core",
        "ogcapi-tiles-1/1.0/conf/tileset",
        "ogcapi-tiles-1/1.0/conf/tilesets-list",
        "ogcapi-tiles-1/1.0/conf/geodata-tilesets",
        "ogcapi-tiles-1/1.0/conf/mvt",
        "ogcapi-tiles-1/1.0/conf/tilejson",
        "cql2/1.0/conf/cql2-text",
        "cql2/1.0/conf/cql2-json",
        "cql2/1.0/conf/basic-cql2",
        "cql2/1.0/conf/advanced-comparison-operators",
        "cql2/1.0/conf/case-insensitive-comparison",
        "cql2/1.0/conf/basic-spatial-functions",
        "cql2/1.0/conf/spatial-functions",
        "cql2/1.0/conf/property-property",
        "cql2/1.0/conf/arithmetic",
    )
)


def link(href: str, rel: str, kind: str, title: str = "") -> JsonObject:
    """A link."""
    return {"href": href, "rel": rel, "type": kind, **({"title": title} if title else {})}


def landing_page(asked: Asked) -> JsonObject:
    """The landing page: where everything is."""
    return {
        "title": TITLE,
        "description": DESCRIPTION,
        "links": [
            link(asked.url("/"), "self", JSON, "This page"),
            link(asked.url("/", f="html"), "alternate", "text/html", "This page for people"),
            link(asked.url("/viewer/"), "preview", "text/html", "The map, to look at and to label anchors in"),
            link(asked.url("/api"), "service-desc", OPENAPI_JSON, "The API's definition"),
            link(asked.url("/conformance"), "conformance", JSON, "What it conforms to"),
            link(asked.url("/collections"), "data", JSON, "The collections"),
            link(asked.url("/versions"), f"{REL}/version-history", JSON, "The map's versions"),
            link(asked.url("/tileMatrixSets"), f"{REL}/tiling-schemes", JSON, "The tile matrix sets"),
        ],
    }


def conformance() -> JsonObject:
    """What the API conforms to."""
    return {"conformsTo": list(CONFORMANCE)}


def versions_document(asked: Asked, state: MapState | None, history: Sequence[VersionSummary]) -> JsonObject:
    """Every map version there is, the newest last, and what is said of the newest of them."""
    return {
        "map_version": None if state is None else state.newest,
        "solved_ns": None if state is None else state.solved_ns,
        "versions": [] if state is None else list(state.versions),
        "history": [asdict(one) for one in history],
        "links": [link(asked.url(), "self", JSON)],
    }


def collection_list(asked: Asked, layers: Sequence[Layer], state: MapState | None) -> JsonObject:
    """All collections."""
    return {
        "links": [link(asked.url("/collections"), "self", JSON, "All collections")],
        "crs": [one.uri for one in offered_crs(state.crs)] if state is not None else [CRS84_URI],
        "collections": [collection(asked, layer, state) for layer in layers],
    }


def collection(asked: Asked, layer: Layer, state: MapState | None) -> JsonObject:
    """One collection."""
    values = {
        "id": layer.name,
        "title": layer.title,
        "description": layer.description,
        "itemType": "feature",
        "extent": _extent(layer, state),
        "links": _collection_links(asked, layer),
    }
    if state is None:
        return {**values, "crs": [CRS84_URI], "storageCrs": CRS84_URI}
    crs = [one.uri for one in offered_crs(state.crs)]
    return {**values, "crs": crs, "storageCrs": storage_crs(state.crs).uri}


def _collection_links(asked: Asked, layer: Layer) -> list[JsonObject]:
    own = f"/collections/{layer.name}"
    links = [
        link(asked.url(own), "self", JSON, layer.title),
        link(asked.url("/collections"), "parent", JSON, "All collections"),
        link(asked.url(f"{own}/items"), "items", GEOJSON, "Its features"),
        link(asked.url(f"{own}/queryables"), f"{REL}/queryables", SCHEMA_JSON, "What conditions can be put on"),
    ]
    if layer.tiled:
        links.append(link(asked.url(f"{own}/tiles"), f"{REL}/tilesets-vector", JSON, "Its vector tiles"))
    return links


def _extent(layer: Layer, state: MapState | None) -> JsonObject:
    """The landmarks' box and span; other layers lie around them."""
    extent: JsonObject = {}
    if state is not None and state.box is not None and layer.geometry:
        box = state.box
        corners = [box.lon_min_deg, box.lat_min_deg, box.lon_max_deg, box.lat_max_deg]
        extent["spatial"] = {"bbox": [corners], "crs": CRS84_URI}
    if state is not None and state.seen is not None and layer is LANDMARKS:
        moments = [_utc(state.seen.first_ns), _utc(state.seen.last_ns)]
        extent["temporal"] = {"interval": [moments], "trs": "http://www.opengis.net/def/uom/ISO-8601/0/Gregorian"}
    return extent


def _utc(stamp_ns: int) -> str | None:
    try:
        return datetime.fromtimestamp(stamp_ns // 1_000_000_000, tz=UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
    except (ValueError, OverflowError, OSError):  # a clock that was never set: no moment a calendar knows
        return None


def queryables(asked: Asked, layer: Layer) -> JsonObject:
    """What conditions can be put on, as a JSON Schema."""
    properties = {one.name: property_schema(one) for one in layer.properties if one.comparable}
    if layer.geometry:
        properties[GEOMETRY] = {
            "title": "geometry",
            "x-ogc-role": "primary-geometry",
            "format": f"geometry-{layer.geometry.lower()}",
        }
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "$id": asked.url(f"/collections/{layer.name}/queryables"),
        "type": "object",
        "title": layer.title,
        "properties": properties,
        "additionalProperties": False,
    }


def property_schema(one: Property) -> JsonObject:
    """A property as a JSON Schema."""
    return {"title": one.name, "type": one.kind, "description": one.description}


def tileset_list(asked: Asked, layer: Layer) -> JsonObject:
    """The tile sets of a collection: one."""
    own = f"/collections/{layer.name}/tiles"
    return {
        "links": [link(asked.url(own), "self", JSON)],
        "tilesets": [
            {
                "title": layer.title,
                "dataType": "vector",
                "crs": MERCATOR_URI,
                "tileMatrixSetURI": QUADS_URI,
                "links": [link(asked.url(f"{own}/{QUADS}"), "self", JSON), *_tile_links(asked, layer)],
            }
        ],
    }


def tileset(asked: Asked, layer: Layer, state: MapState | None) -> JsonObject:
    """The tile set's metadata."""
    own = f"/collections/{layer.name}/tiles/{QUADS}"
    values: JsonObject = {
        "title": layer.title,
        "description": layer.description,
        "dataType": "vector",
        "crs": MERCATOR_URI,
        "tileMatrixSetURI": QUADS_URI,
        "links": [link(asked.url(own), "self", JSON), *_tile_links(asked, layer)],
        "layers": [_tile_layer(layer)],
    }
    if state is not None and state.box is not None:
        box = state.box
        values["boundingBox"] = {
            "lowerLeft": [box.lon_min_deg, box.lat_min_deg],
            "upperRight": [box.lon_max_deg, box.lat_max_deg],
            "crs": CRS84_URI,
        }
    return values


def _tile_links(asked: Asked, layer: Layer) -> list[JsonObject]:
    own = f"/collections/{layer.name}/tiles/{QUADS}"
    return [
        link(f"{asked.url('/tileMatrixSets')}/{QUADS}", f"{REL}/tiling-scheme", JSON),
        {
            **link(f"{asked.url(own)}/{{tileMatrix}}/{{tileRow}}/{{tileCol}}", "item", MVT, "The tiles"),
            "templated": True,
        },
        link(asked.url(f"/tiles/{layer.name}.json"), "describedby", JSON, "TileJSON"),
    ]


def _tile_layer(layer: Layer) -> JsonObject:
    return {
        "id": layer.name,
        "dataType": "vector",
        "geometryDimension": 0 if layer.geometry == "Point" else 1,
        "propertiesSchema": {"type": "object", "properties": {name: {} for name in TILE_PROPERTIES[layer.name]}},
    }


def tilejson(asked: Asked, layer: Layer, state: MapState | None, *, as_of: int | None) -> JsonObject:
    """TileJSON 3.0.0; of a version that was asked for the tiles' addresses name it."""
    prefix = "" if as_of is None else f"/v/{as_of}"
    values: JsonObject = {
        "tilejson": "3.0.0",
        "name": layer.title,
        "description": layer.description,
        "scheme": "xyz",
        "tiles": [f"{asked.url(f'{prefix}/tiles/{layer.name}')}/{{z}}/{{x}}/{{y}}"],
        "minzoom": 0,
        "maxzoom": ZOOM_MOST,
        "vector_layers": [{"id": layer.name, "fields": _fields(layer)}],
        "map_version": as_of if as_of is not None or state is None else state.newest,
    }
    if state is not None and state.box is not None:
        box = state.box
        values["bounds"] = [box.lon_min_deg, box.lat_min_deg, box.lon_max_deg, box.lat_max_deg]
    return values


def _fields(layer: Layer) -> Mapping[str, str]:
    described = {one.name: one.description for one in layer.properties}
    return {
        name: described.get(name, "How many more are in the place of the one that is shown")
        for name in TILE_PROPERTIES[layer.name]
    }


def tile_matrix_set_list(asked: Asked) -> JsonObject:
    """The tile matrix sets: one."""
    href = f"{asked.url('/tileMatrixSets')}/{QUADS}"
    return {"tileMatrixSets": [{"id": QUADS, "uri": QUADS_URI, "links": [link(href, "self", JSON)]}]}


def tile_matrix_set() -> JsonObject:
    """WebMercatorQuad (OGC 17-083r4, D.1)."""
    half_m = 20_037_508.342789244
    matrices = [
        {
            "id": str(zoom),
            "scaleDenominator": 559_082_264.028717 / (1 << zoom),
            "cellSize": half_m / 128 / (1 << zoom),
            "cornerOfOrigin": "topLeft",
            "pointOfOrigin": [-half_m, half_m],
            "tileWidth": 256,
            "tileHeight": 256,
            "matrixWidth": 1 << zoom,
            "matrixHeight": 1 << zoom,
        }
        for zoom in range(ZOOM_MOST + 1)
    ]
    return {
        "id": QUADS,
        "title": "Google Maps Compatible for the World",
        "uri": QUADS_URI,
        "crs": MERCATOR_URI,
        "wellKnownScaleSet": "http://www.opengis.net/def/wkss/OGC/1.0/GoogleMapsCompatible",
        "orderedAxes": ["X", "Y"],
        "description": f"Latitudes to {MERCATOR_LIMIT_DEG:.6f} degrees; tiles have {EXTENT} units a side",
        "tileMatrices": matrices,
    }
