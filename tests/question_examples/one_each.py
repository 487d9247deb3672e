"""Values with something in every field."""

from landmark_maps.examples import START_NS, landmark
from trigpoint.geodesy.web_tiles import WebTile
from trigpoint.landmarks.asked import (
    AnsweredMap,
    AnswerForm,
    ChangeAnswer,
    ChangeQuestion,
    CoverageAnswer,
    CoverageQuestion,
    CoveredTile,
    LandmarkAnswer,
    LandmarkQuestion,
    Question,
    Refusal,
    TileChange,
    VersionChange,
)
from trigpoint.landmarks.messages import (
    change_answer_bytes,
    coverage_answer_bytes,
    entry_of,
    landmark_answer_bytes,
    landmark_bytes,
    placed_entry_of,
    refusal_bytes,
)
from trigpoint.landmarks.model import Landmark
from trigpoint.landmarks.notices import version_change_bytes
from trigpoint.landmarks.paging import next_page_token
from trigpoint.landmarks.queries import DegreeBox, Disc, LandmarkQuery, Nearest, PageMark, TimeSpan

BOX = DegreeBox(lon_min_deg=151.1, lat_min_deg=-33.9, lon_max_deg=151.3, lat_max_deg=-33.8)
SPAN = TimeSpan(first_ns=START_NS, last_ns=START_NS + 7)
DISC = Disc(lat_deg=-33.89, lon_deg=151.19, radius_m=250.0)
NEAREST = Nearest(lat_deg=-33.89, lon_deg=151.19, count=25)
MAP = AnsweredMap(
    map_version=7, solved_ns=START_NS, crs="EPSG:32756", origin_easting_m=332_000.0, origin_northing_m=6_248_000.0
)
TILE = WebTile(16, 60291, 39328)
POINT = (332_001.5, 6_248_002.5)


def row(name: str) -> Landmark:
    """A landmark as it is told: without provenance."""
    fixed = landmark(name, 1.5, 2.5, map_version=3)._replace(lat_deg=-33.9, lon_deg=151.2, provenance="")
    return fixed._replace(valid_to_version=9)


TILE_CHANGE = TileChange(tile=TILE, before=6, after=7, changed=(row("L1"),), removed=("L2", "ö/3"))
VERSION_CHANGE = VersionChange(map=MAP, before=6, tiles=frozenset({TILE, WebTile(16, 60292, 39328)}))
LANDMARKS = LandmarkAnswer(map=MAP, landmarks=(row("L1"), row("ö")), next_page="token")
PLACED = LandmarkAnswer(map=MAP, landmarks=(row("L1"),), crs="EPSG:32756", points=(POINT,))
CHANGES = ChangeAnswer(map=MAP, since=4, changed=(row("L1"),), removed=("L2",))
COVERAGE = CoverageAnswer(
    map=MAP,
    tiles=(CoveredTile(tile=WebTile(20, 9, 8), vehicle="veh-a", first_ns=START_NS, last_ns=START_NS, sweep_count=3),),
)
REFUSAL = Refusal(reason="invalid", detail="limit 0 is under 1")


def questions() -> tuple[Question, ...]:
    """Landmarks, changes, coverage."""
    query = LandmarkQuery(
        bbox=BOX, near=DISC, kinds=("pole", ""), max_sigma_m=0.5, vehicle="veh-a", seen=SPAN, as_of=7, limit=25
    )
    page = next_page_token(query, PageMark(landmark="L1", distance_m=3.25))
    return (
        LandmarkQuestion(query=query, page=page, crs="EPSG:32756", form=AnswerForm.GEOJSON),
        ChangeQuestion(query=LandmarkQuery(bbox=BOX), since=4),
        CoverageQuestion(bbox=BOX, seen=SPAN, vehicle="veh-a"),
        LandmarkQuestion(query=LandmarkQuery(nearest=NEAREST)),
    )


def answers() -> tuple[bytes, ...]:
    """Landmarks, changes, coverage, a refusal and a version, encoded; then landmarks with positions in a CRS."""
    entries = [entry_of(landmark_bytes(one)) for one in LANDMARKS.landmarks]
    return (
        landmark_answer_bytes(MAP, entries, next_page="token"),
        change_answer_bytes(MAP, since=4, changed=CHANGES.changed, removed=CHANGES.removed),
        coverage_answer_bytes(COVERAGE, zoom=20),
        refusal_bytes(REFUSAL),
        version_change_bytes(VERSION_CHANGE),
        landmark_answer_bytes(MAP, [placed_entry_of(landmark_bytes(PLACED.landmarks[0]), POINT)], crs="EPSG:32756"),
    )
