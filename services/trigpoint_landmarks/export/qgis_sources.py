"""What a QGIS project is made from: a service, which is asked, or a GeoPackage that was exported."""

import json
import os
import re
from collections.abc import Mapping
from http.client import HTTPException, HTTPMessage
from pathlib import Path
from typing import IO, Any
from urllib.error import HTTPError, URLError
from urllib.parse import quote, urlsplit
from urllib.request import HTTPRedirectHandler, Request, build_opener

import numpy as np

from trigpoint.errors import InputError, ServiceError
from trigpoint.geodesy.projection import WGS84, transform_coordinates
from trigpoint.landmarks.feature_crs import CRS84, EPSG_URI
from trigpoint.landmarks.geopackage_writing import read_handed_over
from trigpoint.landmarks.layers import ANCHORS, LANDMARKS, LAYERS, TRAJECTORIES, Layer
from trigpoint.observability.masking import without_password
from trigpoint_landmarks.export.colours import KNOWN
from trigpoint_landmarks.export.provenance import crs_name
from trigpoint_landmarks.export.qgis_project import MERCATOR, Project, ProjectLayer

TOP_DOWN = (ANCHORS, LANDMARKS, TRAJECTORIES)
ANSWER_BYTES_MOST = 1_000_000
ANSWER_TIMEOUT_S = 10.0
ZOOM_MOST = 22
FEATURES_SCALE = 25_000  # farther away, tiles are drawn: no more than what is there is asked for feature by feature

# No quotes, which a data source's text ends at, and no user: a password would stand in every project.
ADDRESS = re.compile(r"https?://[A-Za-z0-9.\-\[\]:]+(/[A-Za-z0-9._~%/\-]*)?")

Extent = tuple[float, float, float, float]


def project_of_service(url: str, *, token: str = "", authcfg: str = "") -> Project:
    """A project that opens a service by OGC API Features and vector tiles.

    `authcfg` is the id under which the QGIS that opens it keeps the service's token. Raises InputError for an address
    that is none and a service without a map, ServiceError where it does not answer as it should.
    """
    address = _address(url)
    collection = _asked(f"{address}/collections/{LANDMARKS.name}", token)
    version = _asked(f"{address}/versions", token).get("map_version")
    storage = str(collection.get("storageCrs", ""))
    if version is None or not storage.startswith(EPSG_URI):
        raise InputError(f"{address}: it serves no map whose CRS has an EPSG code")
    map_crs = f"EPSG:{storage.removeprefix(EPSG_URI)}"
    auth = f" authcfg={authcfg}" if authcfg else ""
    layers = [_features_of(layer, address, auth) for layer in TOP_DOWN]
    tiles = [_tiles_of(layer, address, authcfg) for layer in (LANDMARKS, TRAJECTORIES)]
    return Project(
        title=f"Landmark map of {urlsplit(address).netloc}",
        abstract=f"The newest map version of {address}, live; it was {version} when this project was made.",
        map_crs=map_crs,
        extent=_on_grid(collection, map_crs),
        layers=(*layers, *tiles),
    )


def project_of_geopackage(path: Path, *, beside: Path) -> Project:
    """A project in the folder `beside` that opens an exported GeoPackage. Raises InputError for any other file."""
    held = read_handed_over(path)
    provenance = json.loads(held.metadata)
    crs, map_crs = _known(str(provenance["crs"])), str(provenance["map_crs"])
    relative = Path(os.path.relpath(path.absolute(), beside.absolute()))
    source = f"./{relative.as_posix()}" if not relative.is_absolute() else relative.as_posix()
    named = [layer for layer in (*TOP_DOWN, *LAYERS.values()) if layer.name in held.tables]
    layers = tuple(
        ProjectLayer(
            layer=layer,
            name=layer.title,
            provider="ogr",
            source=f"{source}|layername={layer.name}",
            crs=crs,
            kinds=held.kinds.get(layer.name, ()),
        )
        for layer in dict.fromkeys(named)
    )
    version, epoch = provenance["map_version"], provenance["coordinate_epoch"]
    return Project(
        title=f"Landmark map, version {version}",
        abstract=f"Map version {version} of {provenance['generator']}, {crs}, coordinate epoch {epoch}.",
        map_crs=map_crs,
        extent=_moved(held.extent, crs, map_crs),
        layers=layers,
    )


def _address(url: str) -> str:
    """The address of a service. Raises InputError for what is none, and for one with a password in it."""
    if not ADDRESS.fullmatch(url):
        raise InputError(
            f"server {without_password(url)[:100]!r}: http://HOST or https://HOST, with port and path, is needed"
        )
    return url.rstrip("/")


def _known(crs: str) -> str:
    """The name by which a GeoPackage knows a CRS."""
    return WGS84 if crs == crs_name(CRS84) else crs


def _features_of(layer: Layer, address: str, auth: str) -> ProjectLayer:
    typed = f"typename='{layer.name}' url='{address}' version='OGC_API_FEATURES'"
    return ProjectLayer(
        layer=layer,
        name=layer.title,
        provider="OAPIF",
        source=f"pagingEnabled='true' pageSize='1000' restrictToRequestBBOX='1' srsname='OGC:CRS84' {typed}{auth}",
        crs="OGC:CRS84",
        kinds=tuple(KNOWN) if layer.property_named("kind") is not None else (),
        scale_limit=FEATURES_SCALE if layer is LANDMARKS else None,
    )


def _tiles_of(layer: Layer, address: str, authcfg: str) -> ProjectLayer:
    pattern = quote(f"{address}/tiles/{layer.name}/{{z}}/{{x}}/{{y}}", safe="/:")
    auth = f"&authcfg={authcfg}" if authcfg else ""
    return ProjectLayer(
        layer=layer,
        name=f"{layer.title} (tiles)",
        provider="vectortile",
        source=f"type=xyz&url={pattern}&zmin=0&zmax={ZOOM_MOST}{auth}",
        crs=MERCATOR,
        tiled=True,
    )


class _Staying(HTTPRedirectHandler):
    """Follows nobody elsewhere: the token is for the service that was named."""

    def redirect_request(
        self, req: Request, fp: IO[bytes], code: int, msg: str, headers: HTTPMessage, newurl: str
    ) -> None:
        """No other request."""


OPENER = build_opener(_Staying())


def _asked(address: str, token: str) -> Mapping[str, Any]:
    headers = {"Authorization": f"Bearer {token}"} if token else {}
    try:
        with OPENER.open(Request(address, headers=headers), timeout=ANSWER_TIMEOUT_S) as answer:
            content = answer.read(ANSWER_BYTES_MOST + 1)
            said = json.loads(content)
    except HTTPError as error:
        raise InputError(f"{address}: status {error.code}, {error.reason}") from error
    except (URLError, HTTPException, OSError) as error:
        raise ServiceError(f"{address}: no answer: {getattr(error, 'reason', error)}") from error
    except ValueError as error:
        raise InputError(f"{address}: the answer of {len(content)} bytes is no JSON of a map service") from error
    if not isinstance(said, dict):
        raise InputError(f"{address}: the answer is no JSON object")
    return said


def _on_grid(collection: Mapping[str, Any], map_crs: str) -> Extent | None:
    """The landmarks' box as a service tells it, on the map's grid."""
    boxes = collection.get("extent", {}).get("spatial", {}).get("bbox", [])
    if not boxes or len(boxes[0]) != 4:
        return None
    return _moved(tuple(boxes[0]), WGS84, map_crs)


def _moved(box: Extent | None, source: str, target: str) -> Extent | None:
    if box is None or source == target:
        return box
    west, south, east, north = box
    x, y = transform_coordinates(
        np.array([west, east, west, east]),
        np.array([south, south, north, north]),
        source_crs=source,
        target_crs=target,
    )
    return float(x.min()), float(y.min()), float(x.max()), float(y.max())
