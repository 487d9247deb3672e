"""Anchors from files of three formats end in the log once, in WGS84; what cannot be right is refused and named."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
import shapely
from pyogrio import raw as ogr

from trigpoint.errors import FrameRefused, InputError
from trigpoint.events.codec import Event
from trigpoint.events.corrected import AnchorLabelled
from trigpoint.events.observed import EventRefused, MapFramePinned
from trigpoint.geodesy.positions import Wgs84Position
from trigpoint.geodesy.projection import WGS84, transform_coordinates
from trigpoint.logs.memory_log import MemoryLog
from trigpoint_ingest.anchor_files import read_anchor_file
from trigpoint_ingest.anchors import import_anchors
from trigpoint_ingest.core.anchors import distance_m

LAT_DEG, LON_DEG = -33.8886, 151.1946
NEAR_M = 1e-3  # m: a projection and its inverse close to far under a millimetre; a text of 9 digits to 0.1 mm


def grid(crs: str) -> tuple[float, float]:
    x, y = transform_coordinates(np.array([LON_DEG]), np.array([LAT_DEG]), source_crs=WGS84, target_crs=crs)
    return float(x[0]), float(y[0])


def collection(*features: tuple[str, float, float], crs: str | None = None, **properties: object) -> str:
    body: dict[str, object] = {
        "type": "FeatureCollection",
        "features": [
            {
                "type": "Feature",
                "geometry": {"type": "Point", "coordinates": [x, y]},
                "properties": {"anchor": name, **properties},
            }
            for name, x, y in features
        ],
    }
    if crs is not None:
        body["crs"] = {"type": "name", "properties": {"name": crs}}
    return json.dumps(body)


def written(tmp_path: Path, name: str, text: str) -> Path:
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    return path


def geopackage(path: Path, *, crs: str | None, geometry: shapely.Geometry) -> Path:
    ogr.write(
        path,
        geometry=shapely.to_wkb(np.array([geometry])),
        field_data=[np.array(["p1"], dtype=object), np.array(["img-1"], dtype=object), np.array([0.07])],
        fields=np.array(["anchor", "image", "sigma_m"], dtype=object),
        geometry_type=geometry.geom_type,
        crs=crs,
        driver="GPKG",
    )
    return path


def only_anchor(path: Path, **options: str) -> AnchorLabelled:
    found = read_anchor_file(path, crs=options.get("crs"), image=options.get("image"))
    assert found.refused == ()
    (anchor,) = found.anchors
    return anchor


def assert_in_place(anchor: AnchorLabelled) -> None:
    there = Wgs84Position(anchor.lat_deg, anchor.lon_deg)
    assert distance_m(Wgs84Position(LAT_DEG, LON_DEG), there) < NEAR_M


def events(log: MemoryLog, stream: str) -> list[Event]:
    return [row.envelope.event for row in log.read(stream)]


def test_geojson_is_wgs84(tmp_path: Path) -> None:
    anchor = only_anchor(written(tmp_path, "a.geojson", collection(("p1", LON_DEG, LAT_DEG), kind="pole")))
    assert (anchor.lat_deg, anchor.lon_deg, anchor.kind) == (LAT_DEG, LON_DEG, "pole")


def test_the_crs_member_of_older_geojson_is_honoured(tmp_path: Path) -> None:
    text = collection(("p1", *grid("EPSG:32756")), crs="urn:ogc:def:crs:EPSG::32756")
    anchor = only_anchor(written(tmp_path, "a.json", text))
    assert_in_place(anchor)
    assert anchor.source_crs == "urn:ogc:def:crs:EPSG::32756"


def test_crs84_as_gdal_writes_it_is_wgs84(tmp_path: Path) -> None:
    text = collection(("p1", LON_DEG, LAT_DEG), crs="urn:ogc:def:crs:OGC:1.3:CRS84")
    assert only_anchor(written(tmp_path, "a.geojson", text)).source_crs == WGS84


def test_a_geopackages_own_crs_is_used(tmp_path: Path) -> None:
    point = shapely.Point(*grid("EPSG:32756"))
    anchor = only_anchor(geopackage(tmp_path / "a.gpkg", crs="EPSG:32756", geometry=point))
    assert_in_place(anchor)
    assert (anchor.anchor, anchor.image, anchor.sigma_m) == ("p1", "img-1", 0.07)


def test_a_csv_in_a_grid_takes_the_crs_given(tmp_path: Path) -> None:
    x, y = grid("EPSG:28356")
    path = written(tmp_path, "a.csv", f"id,easting,northing,image,sigma_m\np1,{x!r},{y!r},img-1,0.2\n")
    anchor = only_anchor(path, crs="EPSG:28356")
    assert_in_place(anchor)
    assert "GDA94" in anchor.operation


def test_a_csv_may_name_the_crs_in_a_column(tmp_path: Path) -> None:
    x, y = grid("EPSG:3857")
    assert_in_place(only_anchor(written(tmp_path, "a.csv", f"anchor,x,y,crs\np1,{x!r},{y!r},EPSG:3857\n")))


def test_a_csv_with_latitude_and_longitude_is_wgs84(tmp_path: Path) -> None:
    anchor = only_anchor(written(tmp_path, "a.csv", f"\ufeffAnchor,Lat,Lon\np1,{LAT_DEG},{LON_DEG}\n"))
    assert (anchor.lat_deg, anchor.lon_deg, anchor.source_crs) == (LAT_DEG, LON_DEG, WGS84)


def test_an_image_given_holds_for_all(tmp_path: Path) -> None:
    path = written(tmp_path, "a.geojson", collection(("p1", LON_DEG, LAT_DEG), image="other"))
    anchor = only_anchor(path, image="img-7")
    assert (anchor.image, anchor.image_sigma_m) == ("img-7", 0.35)


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("a.csv", "anchor,easting,northing\np1,1,2\n", "line 2: easting and northing without a CRS"),
        ("a.csv", "anchor,x,y,crs\np1,1,2,EPSG:99999\n", "EPSG:99999"),
        ("a.geojson", collection(("p1", 1.0, 2.0), crs="EPSG:99999"), "EPSG:99999"),
    ],
)
def test_a_missing_or_unknown_crs_is_refused(tmp_path: Path, name: str, text: str, message: str) -> None:
    with pytest.raises(FrameRefused, match=message):
        read_anchor_file(written(tmp_path, name, text))


def test_a_geopackage_without_crs_is_refused(tmp_path: Path) -> None:
    with pytest.warns(UserWarning, match="crs"):
        path = geopackage(tmp_path / "a.gpkg", crs=None, geometry=shapely.Point(1.0, 2.0))
    with pytest.raises(FrameRefused):
        read_anchor_file(path)


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("a.csv", "", "columns none"),
        ("a.csv", "anchor,east\np1,1\n", "lat and lon, or easting and northing"),
        ("a.csv", "anchor,lat,lon\n", "no anchor"),
        ("a.csv", "anchor,lat,lon\np1,south,151\n", "line 2: lat is 'south'"),
        ("a.csv", "name,lat,lon,sigma_m\np1,-33,151,fine\n", r"a\.csv, line 2: sigma_m is 'fine'"),
        ("a.geojson", "", "cannot be read as a GeoJSON"),
        ("a.geojson", '{"type": "Feature"}', "features"),
        ("a.geojson", collection(), "no anchor"),
        ("a.gpkg", "this is no GeoPackage", "cannot be read as a GeoPackage"),
        ("a.shp", "", "none of .geojson"),
    ],
)
def test_a_file_that_is_not_what_it_should_be_is_named(tmp_path: Path, name: str, text: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        read_anchor_file(written(tmp_path, name, text))


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"nowhere\.csv is not a file"):
        read_anchor_file(tmp_path / "nowhere.csv")


@pytest.mark.parametrize("geometry", ["LineString", "Polygon", None])
def test_a_geometry_that_is_no_point_is_refused(tmp_path: Path, geometry: str | None) -> None:
    feature = {"type": "Feature", "properties": {}, "geometry": geometry and {"type": geometry, "coordinates": []}}
    text = json.dumps({"type": "FeatureCollection", "features": [feature]})
    with pytest.raises(InputError, match="feature 0 is .*: an anchor is a Point"):
        read_anchor_file(written(tmp_path, "a.geojson", text))


def test_a_line_in_a_geopackage_is_refused(tmp_path: Path) -> None:
    line = shapely.LineString([(0.0, 0.0), (1.0, 1.0)])
    with pytest.raises(InputError, match="LineString: an anchor is a Point"):
        read_anchor_file(geopackage(tmp_path / "a.gpkg", crs="EPSG:32756", geometry=line))


def test_importing_adds_each_anchor_once(tmp_path: Path) -> None:
    log = MemoryLog()
    found = read_anchor_file(
        written(tmp_path, "a.geojson", collection(("p1", LON_DEG, LAT_DEG), ("p2", LON_DEG, LAT_DEG + 1e-3)))
    )
    first, second = import_anchors(found, log), import_anchors(found, log)
    assert (first.added, second.added, second.known) == (2, 0, 2)
    assert events(log, "corrections") == list(found.anchors)


def test_importing_more_of_the_same_adds_only_the_new(tmp_path: Path) -> None:
    log = MemoryLog()
    few = read_anchor_file(written(tmp_path, "a.geojson", collection(("p1", LON_DEG, LAT_DEG))))
    more = read_anchor_file(
        written(tmp_path, "b.geojson", collection(("p1", LON_DEG, LAT_DEG), ("p2", LON_DEG, LAT_DEG + 1e-3)))
    )
    import_anchors(few, log)
    report = import_anchors(more, log)
    assert (report.added, report.known, report.relabelled) == (1, 1, 0)


def test_labelling_anew_and_back_appends_each_time_under_another_identity(tmp_path: Path) -> None:
    log = MemoryLog()
    here = read_anchor_file(written(tmp_path, "a.geojson", collection(("p1", LON_DEG, LAT_DEG))))
    there = read_anchor_file(written(tmp_path, "b.geojson", collection(("p1", LON_DEG, LAT_DEG + 1e-5))))
    reports = [import_anchors(found, log) for found in (here, there, here, there)]
    assert [report.relabelled for report in reports] == [0, 1, 1, 1]
    assert len({row.envelope.identity for row in log.read("corrections")}) == 4


def test_the_first_anchors_pin_the_frame_and_a_misplaced_one_does_not(tmp_path: Path) -> None:
    log = MemoryLog()
    found = read_anchor_file(
        written(
            tmp_path,
            "a.geojson",
            collection(("bad", LON_DEG, -LAT_DEG), ("p1", LON_DEG, LAT_DEG), ("p2", LON_DEG, LAT_DEG + 1e-3)),
        )
    )
    report = import_anchors(found, log)
    (frame,) = events(log, "map")
    assert isinstance(frame, MapFramePinned)
    assert (frame.crs, frame.declared_by) == ("EPSG:32756", "first anchor")
    assert [refused.reason for refused in report.refused] == ["too far"]
    assert report.added == 2


def test_refused_anchors_are_kept_aside_once_and_all_else_goes_in(tmp_path: Path) -> None:
    log = MemoryLog()
    text = collection(("nan", math.nan, LAT_DEG), ("p1", LON_DEG, LAT_DEG), ("far", LON_DEG, -LAT_DEG))
    found = read_anchor_file(written(tmp_path, "a.geojson", text))
    report = import_anchors(found, log)
    import_anchors(found, log)
    kept = [event for event in events(log, "refused") if isinstance(event, EventRefused)]
    assert [event.reason for event in kept] == ["not finite", "too far"]
    assert [line.partition(":")[0] for line in report.complaints()] == ["not finite", "too far"]
    assert len(events(log, "corrections")) == 1
