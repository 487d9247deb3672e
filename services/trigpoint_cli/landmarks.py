"""`trigpoint landmarks`: questions to the landmark database."""

import json
from typing import Any

import click

from trigpoint.errors import InputError
from trigpoint.landmarks.geojson import feature_collection, landmark_list
from trigpoint.landmarks.paging import page_of
from trigpoint.landmarks.queries import LandmarkQuery
from trigpoint_cli.data_dir import DataDirectory, as_of_option, data_option
from trigpoint_cli.database import database_options
from trigpoint_cli.output import Answer, Screen, answering, plain
from trigpoint_landmarks.core.questions import bbox_of, near_of, nearest_of, span_of


@click.command("landmarks")
@data_option
@database_options
@click.option("--bbox", metavar="LON_MIN,LAT_MIN,LON_MAX,LAT_MAX", help="Only inside this box, in degrees.")
@click.option("--near", metavar="LAT,LON", help="Only near this position, in degrees; nearest first.")
@click.option("--radius-m", type=float, metavar="R", help="How near, in metres on the ground; goes with --near.")
@click.option("--nearest", type=int, metavar="K", help="So many of the nearest, however far; goes with --near.")
@click.option("--kind", "kinds", multiple=True, help="Only of this kind, or of one of several.")
@click.option("--max-sigma-m", type=float, metavar="S", help="Only where the 1-sigma ellipse is at most so long.")
@click.option("--vehicle", metavar="NAME", help="Only what this vehicle saw.")
@click.option("--seen", metavar="FIRST_NS,LAST_NS", help="Only what was seen between two times (ns since 1970).")
@as_of_option
@click.option("--limit", type=int, metavar="N", help="At most so many; the answer has the token of the next page.")
@click.option("--page", default="", metavar="TOKEN", help="The next page of an answer, by its token.")
@click.option("--geojson", is_flag=True, help="A GeoJSON FeatureCollection instead.")
@answering
def command(data: DataDirectory, geojson: bool, page: str, *, screen: Screen, **asked: Any) -> Answer:
    """Ask for landmarks: all of them, or those in a box or around a position."""
    query = _query(**asked)
    with data.opened_database(read_only=True) as store:
        answer = page_of(store, query, token=page)
    found, map_version = answer.landmarks, answer.map_version or None
    more = {"next_page": answer.next_page} if answer.next_page else {}
    if geojson:
        collection = feature_collection(found, map_version=map_version) | more
        return Answer(collection, (json.dumps(plain(collection)),))
    lines = [
        f"{one.landmark}  {one.kind:<10} {one.lat_deg:.8f} {one.lon_deg:.8f}  sigma {one.sigma_major_m:.2f} m  "
        f"seen {one.observation_count} times{'  anchored' if one.anchored else ''}"
        for one in found
    ]
    counted = f"{len(found)} landmarks{', more with --page ' + answer.next_page if answer.next_page else ''}"
    return Answer(landmark_list(found, map_version=map_version) | more, (*lines, counted))


def _query(
    *, bbox: str | None, near: str | None, radius_m: float | None, nearest: int | None, seen: str | None, **plain: Any
) -> LandmarkQuery:
    if near is None and (radius_m, nearest) != (None, None):
        raise InputError("--radius-m and --nearest go with --near: it was not given")
    if near is not None and (radius_m is None) == (nearest is None):
        raise InputError("--near and --radius-m go together, or --near and --nearest: one of the two is needed")
    return LandmarkQuery(
        bbox=None if bbox is None else bbox_of(bbox),
        near=None if near is None or radius_m is None else near_of(near, radius_m=radius_m),
        nearest=None if near is None or nearest is None else nearest_of(near, count=nearest),
        seen=None if seen is None else span_of(seen),
        **plain,
    )
