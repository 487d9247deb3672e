"""The whole way of the data by the command, on a campus of a few streets."""

import json
import shutil
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from command_runs.running import Run, trigpoint
from command_runs.small_campus import LABELS, write_small_campus
from dask_clusters.cluster import running_workers
from trigpoint.events.mapped import TrajectorySolved
from trigpoint.events.solved import SolvedMap
from trigpoint.logs.mcap_log import McapLog
from trigpoint.logs.readings import logged_maps, logged_verdicts
from trigpoint_cli.data_dir import DataDirectory
from trigpoint_cli.serving.measured_drives import LoggedMeasurements
from trigpoint_landmarks.http.ports import DrivenPath
from trigpoint_vehicle.app import Written

Floats = NDArray[np.float64]

ERROR_KEYS = {"count", "mean", "median", "rmse", "p95", "max"}


@dataclass(frozen=True, slots=True, kw_only=True)
class BuiltCampus:
    data: Path
    written: Written
    ingested: Run
    imported: Run
    built: Run


@pytest.fixture(scope="module")
def campus(tmp_path_factory: pytest.TempPathFactory) -> BuiltCampus:
    folder = tmp_path_factory.mktemp("campus")
    data, written = folder / "data", write_small_campus(folder / "raw")
    assert written.anchors is not None
    return BuiltCampus(
        data=data,
        written=written,
        ingested=trigpoint("ingest", *written.logs, "--data", data, "--json"),
        imported=trigpoint("anchors", "import", written.anchors, "--data", data, "--json"),
        built=trigpoint("build", "--data", data, "--json"),
    )


def test_every_event_is_taken_in_and_counted_by_vehicle(campus: BuiltCampus) -> None:
    answer = campus.ingested.answer
    assert campus.ingested.status == 0
    assert answer["accepted"] == sum(one["accepted"] for one in answer["vehicles"].values()) > 10_000
    assert (answer["duplicates"], answer["refused"], answer["damaged"]) == (0, {}, [])


def test_the_same_logs_again_change_nothing(campus: BuiltCampus, tmp_path: Path) -> None:
    data = shutil.copytree(campus.data, tmp_path / "data")
    answer = trigpoint("ingest", *campus.written.logs, "--data", data, "--json").answer
    assert (answer["accepted"], answer["duplicates"]) == (0, campus.ingested.answer["accepted"])
    again = trigpoint("anchors", "import", str(campus.written.anchors), "--data", data, "--json").answer
    assert again["anchors"] == {"added": 0, "known": LABELS, "relabelled": 0, "refused": 0}


def test_paths_by_odometry_begin_where_the_map_has_them_and_drift_from_there(campus: BuiltCampus) -> None:
    measured = LoggedMeasurements(DataDirectory(campus.data))
    solved = {(one.vehicle, one.boot_id): one for one in newest_map(campus.data).trajectories}
    paths = measured.paths("odometry")
    assert [(one.vehicle, one.boot_id) for one in paths] == sorted(solved)
    for path in paths:
        path_m = on_path_m(path, solved[path.vehicle, path.boot_id])
        assert path_m[0] < 0.5  # m: the keyframe nearest to the first wheel message
        assert 1.0 < path_m[-1] < 200.0  # m, after a kilometre by nominal wheels


def test_filtered_paths_stay_beside_the_solved_ones(campus: BuiltCampus) -> None:
    solved = {(one.vehicle, one.boot_id): one for one in newest_map(campus.data).trajectories}
    for path in LoggedMeasurements(DataDirectory(campus.data)).paths("filtered"):
        assert np.median(on_path_m(path, solved[path.vehicle, path.boot_id])) < 5.0  # m: what fixes are off by


def test_every_judged_fix_is_told_with_its_verdict(campus: BuiltCampus) -> None:
    fixes = LoggedMeasurements(DataDirectory(campus.data)).fixes()
    with closing(McapLog(campus.data / "log")) as log:
        verdicts = logged_verdicts(log)
    assert len(fixes) == len(verdicts) > 100
    assert sum(one.accepted for one in fixes) == sum(one.accepted for one in verdicts)
    assert all(one.nis is not None and one.nis > (one.limit or 0.0) for one in fixes if one.reason == "outside gate")


def newest_map(data: Path) -> SolvedMap:
    with closing(McapLog(data / "log")) as log:
        return logged_maps(log)[-1]


def on_path_m(path: DrivenPath, solved: TrajectorySolved) -> Floats:
    """How far a path is from the solved one at its times."""
    within = (path.stamp_ns >= solved.stamp_ns[0]) & (path.stamp_ns <= solved.stamp_ns[-1])
    at = np.column_stack([np.interp(path.stamp_ns[within], solved.stamp_ns, solved.pose[:, axis]) for axis in (0, 1)])
    return np.asarray(np.hypot(*(path.point_m[within] - at).T), dtype=np.float64)


def test_with_anchors_the_map_is_anchored_without_being_asked(campus: BuiltCampus) -> None:
    answer = campus.built.answer
    assert campus.built.status == 0
    assert (answer["map_version"], answer["method"]) == (1, "anchored")
    assert answer["anchors"]["tied"] >= 0.8 * LABELS
    assert answer["landmarks"]["count"] > 80  # of 130, some never in view for long
    assert set(answer["vehicles"]) == {"vehicle-1", "vehicle-2"}
    assert set(answer["anchor_residual_m"]) == ERROR_KEYS


def test_the_map_is_measured_against_truth(campus: BuiltCampus) -> None:
    answer = trigpoint(
        "evaluate", "truth", "--data", campus.data, "--truth", str(campus.written.truth), "--json"
    ).answer
    assert set(answer["error_m"]) == ERROR_KEYS
    assert answer["error_m"]["mean"] < 0.6  # metres: two images of 0.35 m an axis leave about 0.3
    assert answer["error_without_shift_m"]["mean"] < 0.2
    assert answer["gate"]["car_park_accepted"] == 0
    assert answer["nees_is_joint"]
    for vehicle in answer["vehicles"].values():
        assert vehicle["error_m"]["mean"] < vehicle["raw_fix_error_m"]["mean"]


def test_held_out_anchors_are_predicted_better_with_others_tied(campus: BuiltCampus) -> None:
    def mean_m(tied: int) -> float:
        words = ("--tied", tied, "--draws", 50, "--seed", 1, "--json")
        answer = trigpoint("evaluate", "leave-out", "--data", campus.data, *words).answer
        return float(answer["error_m"]["mean"])

    assert mean_m(10) < mean_m(0)


def test_the_whole_curve_has_a_point_for_every_number_of_tied_anchors(campus: BuiltCampus) -> None:
    answer = trigpoint("evaluate", "leave-out", "--data", campus.data, "--draws", 5, "--json").answer
    assert [point["tied"] for point in answer["curve"]] == list(range(answer["anchors"]["count"]))


def test_tying_more_anchors_than_there_are_is_refused(campus: BuiltCampus) -> None:
    said = trigpoint("evaluate", "leave-out", "--data", campus.data, "--tied", 99, "--json")
    assert (said.status, said.answer["exit_status"]) == (2, 2)
    assert "99 labels tied" in said.answer["error"]


def test_the_landmark_database_answers_where_the_map_is(campus: BuiltCampus) -> None:
    everything = trigpoint("landmarks", "--data", campus.data, "--json").answer["landmarks"]
    first = everything["items"][0]
    near = f"{first['lat_deg']},{first['lon_deg']}"
    found = trigpoint("landmarks", "--data", campus.data, f"--near={near}", "--radius-m", 50, "--json").answer[
        "landmarks"
    ]
    assert found["items"][0]["landmark"] == first["landmark"]
    assert 1 <= found["count"] < everything["count"] == campus.built.answer["landmarks"]["count"]


def test_geojson_is_one_feature_collection(campus: BuiltCampus) -> None:
    collection = json.loads(trigpoint("landmarks", "--data", campus.data, "--geojson").out)
    assert collection["type"] == "FeatureCollection"
    assert len(collection["features"]) == campus.built.answer["landmarks"]["count"]


def test_a_landmark_is_explained_down_to_its_sweeps_in_the_log(campus: BuiltCampus) -> None:
    anchored = [
        one
        for one in trigpoint("landmarks", "--data", campus.data, "--json").answer["landmarks"]["items"]
        if one["anchored"]
    ]
    landmark = anchored[0]["landmark"]
    said = trigpoint("explain", landmark, "--data", campus.data, "--json").answer
    assert said["detections"] >= said["observations"]["count"] > 0 == said["observations"]["missing"]
    assert {one["stream"] for one in said["observations"]["items"]} <= {"veh-vehicle-1", "veh-vehicle-2"}
    assert {one["anchor"] for one in said["anchors"]} == set(anchored[0]["anchors"])
    assert [one["event"] for one in said["corrections"]] == ["AnchorLabelled"] * len(said["anchors"])
    assert said["loops"] == []  # without points none are closed
    assert trigpoint("explain", landmark, "--data", campus.data, "--as-of", 1).status == 0


def test_a_version_asked_for_by_number_is_the_same_as_the_newest_one(campus: BuiltCampus) -> None:
    words = ("evaluate", "truth", "--data", campus.data, "--truth", str(campus.written.truth), "--json")
    named, newest = trigpoint(*words, "--as-of", 1).answer, trigpoint(*words).answer
    assert named["error_m"] == newest["error_m"]


@pytest.mark.parametrize(
    "words", [("explain", "lm-1"), ("landmarks",), ("report",), ("evaluate", "truth")], ids=lambda words: words[0]
)
def test_an_unknown_version_ends_with_status_2_and_names_what_there_is(
    campus: BuiltCampus, words: tuple[str, ...]
) -> None:
    truth = ("--truth", str(campus.written.truth)) if words[-1] == "truth" else ()
    said = trigpoint(*words, "--data", campus.data, *truth, "--as-of", 9, "--json")
    assert said.status == 2
    assert "map version 9 is unknown" in said.answer["error"]
    assert "1" in said.answer["error"].partition("unknown")[2]


def test_what_people_corrected_is_listed_and_undone(campus: BuiltCampus, tmp_path: Path) -> None:
    data = shutil.copytree(campus.data, tmp_path / "data")
    excluded = trigpoint("drives", "exclude", "vehicle-2", "--data", data, "--reason", "loose", "--author", "ann")
    assert excluded.status == 0
    drives = trigpoint("drives", "list", "--data", data, "--json").answer["drives"]
    assert [(one["vehicle"], one["excluded"], one["author"]) for one in drives["items"]] == [
        ("vehicle-1", False, None),
        ("vehicle-2", True, "ann"),
    ]
    assert trigpoint("drives", "include", "vehicle-2", "--data", data, "--json").answer["unchanged"] == 0
    name = trigpoint("anchors", "list", "--data", data, "--json").answer["anchors"]["items"][0]["anchor"]
    assert trigpoint("anchors", "retract", name, "--data", data, "--json").answer["retracted"][0]["anchor"] == name
    assert trigpoint("anchors", "retract", name, "--data", data, "--json").answer["unchanged"] == 1
    listed = trigpoint("anchors", "list", "--data", data, "--json").answer["anchors"]
    assert (listed["count"], listed["in_force"]) == (LABELS, LABELS - 1)


def test_replay_finds_no_difference(campus: BuiltCampus) -> None:
    said = trigpoint("replay", "--data", campus.data, "--json")
    assert (said.status, said.answer["differences"]) == (0, 0)


def test_several_logs_are_replayed_and_one_that_cannot_be_read_costs_no_other(
    campus: BuiltCampus, tmp_path: Path
) -> None:
    other, missing = shutil.copytree(campus.data, tmp_path / "other"), tmp_path / "missing"
    said = trigpoint("replay", "--data", campus.data, "--data", missing, "--data", other, "--json")
    assert said.status == 2
    assert [one["data"] for one in said.answer["data"]] == [str(campus.data), str(missing), str(other)]
    assert [one.get("differences") for one in said.answer["data"]] == [0, None, 0]
    assert f"{missing}: no such data directory" in said.answer["data"][1]["error"]


def test_a_log_is_replayed_by_a_worker_elsewhere(campus: BuiltCampus, tmp_path: Path) -> None:
    with running_workers(tmp_path, 1) as address:
        said = trigpoint("replay", "--data", campus.data, "--cluster", address, "--json")
    here = trigpoint("replay", "--data", campus.data, "--json")
    assert said.status == 0
    assert {**said.answer, "wall_s": 0.0} == {**here.answer, "wall_s": 0.0}


def test_one_database_is_not_held_against_two_logs(campus: BuiltCampus, tmp_path: Path) -> None:
    url = f"geopackage:{tmp_path / 'map.gpkg'}"
    said = trigpoint("replay", "--data", campus.data, "--data", tmp_path, "--database", url, "--json")
    assert said.status == 2
    assert "each has its own" in said.answer["error"]


def test_the_log_is_whole_and_says_what_it_holds(campus: BuiltCampus) -> None:
    assert trigpoint("log", "verify", campus.data, "--json").answer["whole"]
    streams = {file["stream"] for file in trigpoint("log", "info", campus.data, "--json").answer["files"]}
    assert {"veh-vehicle-1", "veh-vehicle-2", "map", "corrections", "filtering", "optimisation"} <= streams


def test_a_flipped_bit_in_the_log_is_found(campus: BuiltCampus, tmp_path: Path) -> None:
    data = shutil.copytree(campus.data, tmp_path / "data")
    (path,) = (data / "log" / "veh-vehicle-1").glob("*.mcap")
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)
    said = trigpoint("log", "verify", data, "--json")
    assert said.status == 2
    assert str(path) in said.answer["error"]
    assert not said.answer["whole"]


def test_a_truncated_vehicle_log_ends_with_status_2_and_what_is_whole_is_taken(
    campus: BuiltCampus, tmp_path: Path
) -> None:
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(campus.written.logs[0].read_bytes()[:-2000])
    said = trigpoint("ingest", cut, campus.written.logs[1], "--data", tmp_path / "data", "--json")
    assert said.status == 2
    assert said.answer["damaged"]
    counts = campus.ingested.answer["vehicles"]
    assert said.answer["vehicles"]["vehicle-2"]["accepted"] == counts["vehicle-2"]["accepted"]


def test_the_report_is_written_beside_the_log(campus: BuiltCampus) -> None:
    said = trigpoint("report", "--data", campus.data, "--truth", str(campus.written.truth), "--json")
    page = (campus.data / "report.html").read_text(encoding="utf-8")
    assert said.answer["size_bytes"] == len(page.encode())
    assert "<h2>Held-out anchors</h2>" in page
    assert "<h2>Against truth</h2>" in page


def test_anchors_from_the_wrong_hemisphere_are_refused_and_the_map_stays(campus: BuiltCampus, tmp_path: Path) -> None:
    wrong = tmp_path / "wrong.csv"
    wrong.write_text("anchor,lat,lon,sigma_m\nmirrored,33.89,151.19,0.1\n")
    data = shutil.copytree(campus.data, tmp_path / "data")
    said = trigpoint("anchors", "import", wrong, "--data", data, "--json")
    assert said.status == 2
    assert "mirrored" in said.answer["error"]
    assert said.answer["anchors"]["added"] == 0


@pytest.mark.slow
def test_full_solves_agree_with_the_reduction(campus: BuiltCampus) -> None:
    words = ("--tied", 10, "--draws", 2, "--seed", 1, "--re-solve")
    answer = trigpoint("evaluate", "leave-out", "--data", campus.data, *words, "--json").answer
    assert answer["re_solve"]["mean_error_m"] < 0.005
    assert answer["re_solve"]["prediction_difference_m"]["count"] == answer["error_m"]["count"]


@pytest.mark.slow
def test_withheld_fixes_are_measured_against_a_solve_without_them(campus: BuiltCampus) -> None:
    words = ("--withhold-period-s", 60, "--withhold-duration-s", 20, "--withhold-offset-s", 10)
    answer = trigpoint("evaluate", "gnss", "--data", campus.data, *words, "--json").answer
    assert set(answer["error_m"]) == set(answer["path_difference_m"]) == ERROR_KEYS
    assert answer["error_m"]["count"] == sum(one["error_m"]["count"] for one in answer["vehicles"].values())
    assert answer["path_difference_m"]["median"] < answer["error_m"]["median"]
    assert 0 < answer["error_m"]["count"] <= answer["withheld"]


@pytest.mark.slow
def test_without_anchors_the_map_is_loose(campus: BuiltCampus, tmp_path: Path) -> None:
    trigpoint("ingest", *campus.written.logs, "--data", tmp_path)
    said = trigpoint("build", "--data", tmp_path, "--method", "anchored", "--json")
    assert said.status == 2
    assert "no anchor" in said.answer["error"]
    assert trigpoint("build", "--data", tmp_path, "--json").answer["method"] == "loose"


def test_replay_says_plainly_that_a_shortened_log_does_not_begin_at_0(campus: BuiltCampus, tmp_path: Path) -> None:
    data = shutil.copytree(campus.data, tmp_path / "data")
    stream = "veh-vehicle-1"
    with closing(McapLog(data / "log")) as log:
        count = log.next_number(stream)
    trigpoint("log", "seal", data)
    trigpoint("log", "retain", data, "--keep-bytes", 0, "--passed", f"all:{stream}={count}", "--also-inputs")
    assert f"{stream}: the log begins at number {count}, not at 0" in trigpoint("replay", "--data", data).out
    assert trigpoint("replay", "--data", data, "--json").answer["differences"] == 0


def test_places_are_found_again_in_the_map_by_a_handful_of_landmarks(campus: BuiltCampus) -> None:
    words = ("--data", campus.data, "--truth", str(campus.written.truth), "--places", 40, "--json")
    answer = trigpoint("evaluate", "relocalise", *words).answer
    assert answer["confident_share"] > 0.8
    assert answer["error_in_map_m"]["max"] < 0.5
    assert set(answer["error_m"]) == ERROR_KEYS


def test_a_drive_that_is_found_again_by_what_it_saw_is_near_where_it_was(campus: BuiltCampus) -> None:
    words = ("--data", campus.data, "--truth", str(campus.written.truth), "--places", 20, "--no-signatures", "--json")
    answer = trigpoint("evaluate", "relocalise-drive", "vehicle-1", *words).answer
    assert answer["error_m"]["count"] == round(20 * answer["confident_share"])
    assert answer["off_by_2_m"] == 0


def test_a_vehicle_that_never_drove_is_named_with_those_that_did(campus: BuiltCampus) -> None:
    run = trigpoint(
        "evaluate", "relocalise-drive", "vehicle-9", "--data", campus.data, "--truth", str(campus.written.truth)
    )
    assert run.status == 2
    assert "'vehicle-9' has no drive in the log; these have: vehicle-1, vehicle-2" in run.err
