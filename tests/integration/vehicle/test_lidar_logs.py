"""A simulated drive with a lidar is written as it is cast, with the truth of what it looks at beside it."""

from dataclasses import replace
from itertools import islice

import pytest

from trigpoint.errors import InputError
from trigpoint.events.observed import LandmarksDetected
from trigpoint.events.truth import truth_from_lines
from trigpoint.events.truth_objects import objects_from_lines
from trigpoint.logs.vehicle_log import read_vehicle_log
from trigpoint_vehicle.app import Written, casting_ahead, write_conversion
from trigpoint_vehicle.core.campus import simulate_campus
from trigpoint_vehicle.core.campus_settings import RouteSettings, with_plan
from trigpoint_vehicle.core.lidar.scanned_campus import ScannedCampus, conversion_with_points
from trigpoint_vehicle.core.lidar.scanned_rows import ScannedRows
from trigpoint_vehicle.settings import SimulationSettings
from vehicle_lidar.worlds import scanned


@pytest.fixture(scope="module")
def campus() -> ScannedCampus:
    return scanned()


@pytest.fixture(scope="module")
def written(campus: ScannedCampus, tmp_path_factory: pytest.TempPathFactory) -> Written:
    return write_conversion(conversion_with_points(campus), tmp_path_factory.mktemp("lidar"))


def test_every_sweep_is_in_the_log_as_a_point_cloud(campus: ScannedCampus, written: Written) -> None:
    clouds = [one for one in read_vehicle_log(written.logs[0]) if one.schema_name == "foxglove.PointCloud"]
    assert [one.stamp_ns for one in clouds] == campus.scans[0].stamp_ns().tolist()


def test_truth_has_the_trunks_and_all_corners_as_landmarks_too(campus: ScannedCampus, written: Written) -> None:
    assert written.truth is not None
    assert written.objects is not None
    with written.objects.open(encoding="utf-8", newline="") as file:
        names = {one.name for one in objects_from_lines(file)}
    with written.truth.open(encoding="utf-8", newline="") as file:
        landmarks = {one.landmark for one in truth_from_lines(file).landmarks}
    assert names <= landmarks
    assert {name.split("-")[0] for name in names} == {"pole", "trunk", "corner"}


def test_cast_ahead_on_all_cores_the_rows_are_the_same(campus: ScannedCampus) -> None:
    rows, scans = campus.campus.recordings[0].rows, campus.scans[0]
    alone = ScannedRows(rows, scans, boot_id="b")
    with casting_ahead() as casting:
        together = ScannedRows(rows, scans, boot_id="b", casting=casting)
        pairs = list(islice(zip(alone, together, strict=True), 4000))
    assert all(one.identity == other.identity for one, other in pairs)
    assert all(repr(one.event) == repr(other.event) for one, other in pairs)
    assert repr(alone[3999].event) == repr(pairs[3999][0].event)


def test_points_only_is_a_campus_without_detections() -> None:
    settings = SimulationSettings(vehicles=1, lidar=True, points_only=True)
    standing = replace(settings.campus(), route=RouteSettings(standing_s=10.0))
    rows = simulate_campus(3, with_plan(standing, "standing")).recordings[0].rows
    assert settings.carried_lidar() is not None
    assert not any(isinstance(row.event, LandmarksDetected) for row in rows)


def test_points_only_without_a_lidar_is_refused() -> None:
    with pytest.raises(InputError, match="only vehicles with a lidar have points"):
        SimulationSettings(points_only=True)
