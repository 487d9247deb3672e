"""`trigpoint landmarks`: questions to the landmark database."""

import json

import click

from trigpoint.errors import InputError
from trigpoint.landmarks.geojson import feature_collection, landmark_list
from trigpoint.landmarks.queries import LandmarkQuery
from trigpoint_cli.data_dir import DataDirectory, as_of_option, data_option
from trigpoint_cli.database import database_options
from trigpoint_cli.output import Answer, Screen, answering, plain
from trigpoint_landmarks.core.questions import bbox_of, near_of


@click.command("landmarks")
@data_option
@database_options
@click.option("--bbox", metavar="LON_MIN,LAT_MIN,LON_MAX,LAT_MAX", help="Only inside this box, in degrees.")
@click.option("--near", metavar="LAT,LON", help="Only near this position, in degrees; nearest first.")
@click.option("--radius-m", type=float, metavar="R", help="How near, in metres on the ground; goes with --near.")
@click.option("--kind", help="Only of this kind.")
@as_of_option
@click.option("--limit", type=int, metavar="N", help="At most so many.")
@click.option("--geojson", is_flag=True, help="A GeoJSON FeatureCollection instead.")
@answering
def command(data: DataDirectory, geojson: bool, *, screen: Screen, **asked: str | float | int | None) -> Answer:
    """Ask for landmarks: all of them, or those in a box or around a position."""
    query = _query(**asked)  # type: ignore[arg-type]
    with data.opened_database(read_only=True) as store:
        found, versions = store.landmarks(query), store.map_versions()
    newest = versions[-1].map_version if versions else None
    map_version = query.as_of if query.as_of is not None else newest
    if geojson:
        collection = feature_collection(found, map_version=map_version)
        return Answer(collection, (json.dumps(plain(collection)),))
    lines = [
        f"{one.landmark}  {one.kind:<10} {one.lat_deg:.8f} {one.lon_deg:.8f}  sigma {one.sigma_major_m:.2f} m  "
        f"seen {one.observation_count} times{'  anchored' if one.anchored else ''}"
        for one in found
    ]
    return Answer(landmark_list(found, map_version=map_version), (*lines, f"{len(found)} landmarks"))


def _query(
    bbox: str | None, near: str | None, radius_m: float | None, kind: str | None, as_of: int | None, limit: int | None
) -> LandmarkQuery:
    if (near is None) != (radius_m is None):
        raise InputError("--near and --radius-m go together: one was given without the other")
    return LandmarkQuery(
        bbox=None if bbox is None else bbox_of(bbox),
        near=None if near is None or radius_m is None else near_of(near, radius_m=radius_m),
        kind=kind,
        as_of=as_of,
        limit=limit,
    )
