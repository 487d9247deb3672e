"""`trigpoint build`: a new map version."""

import click
import numpy as np

from trigpoint.errors import InputError
from trigpoint.events.solved import SolvedMap
from trigpoint_cli.data_dir import DataDirectory, data_option
from trigpoint_cli.database import database_options
from trigpoint_cli.output import Answer, JsonObject, Screen, answering, metres
from trigpoint_cli.pipeline import Built, build_map
from trigpoint_evaluation.core.paths import path_length_m
from trigpoint_evaluation.core.summary import summary_of
from trigpoint_optimisation.settings import Edges, Method

METHODS, EDGES = ("rigid", "loose", "anchored"), ("paper", "honest", "close")


def map_values(solved: SolvedMap) -> JsonObject:
    """A map version as a JSON object; the anchors' residuals are what is left of the tied ones."""
    residual_m = np.array([one.residual_m for one in solved.anchors if one.landmark]).reshape(-1, 2)
    return {
        "map_version": solved.head.map_version,
        "method": solved.head.method,
        "landmarks": {
            "count": len(solved.landmarks),
            "anchored": sum(bool(one.anchors) for one in solved.landmarks),
        },
        "anchors": {"count": len(solved.anchors), "tied": len(residual_m)},
        "anchor_residual_m": summary_of(np.hypot(residual_m[:, 0], residual_m[:, 1])),
        "image_offsets": {
            one.image: {
                "offset_m": one.offset_m,
                "sigma_m": np.sqrt(np.maximum(np.diag(one.covariance_m2), 0.0)),
            }
            for one in solved.images
        },
        "vehicles": {
            vehicle: {"drives": _drives_values(solved, vehicle)}
            for vehicle in sorted({one.vehicle for one in solved.trajectories})
        },
    }


def _drives_values(solved: SolvedMap, vehicle: str) -> list[JsonObject]:
    return [
        {
            "boot_id": one.boot_id,
            "poses": len(one.stamp_ns),
            "length_m": path_length_m(one.pose),
            "calibration": {name: {"value": value, "sigma": sigma} for name, value, sigma in one.calibration},
        }
        for one in solved.trajectories
        if one.vehicle == vehicle
    ]


def built_answer(built: Built) -> Answer:
    """What a build says."""
    solved, projection = built.solved, built.projection
    refused = tuple(f"map version {version} is not in the database: {reason}" for version, reason in projection.refused)
    values = map_values(solved) | {"applied": list(projection.applied)}
    residual = values["anchor_residual_m"]
    tied = f", {values['anchors']['tied']} of {len(solved.anchors)} anchors tied, residual {metres(residual.mean)}"
    line = f"map version {solved.head.map_version} ({solved.head.method}): {len(solved.landmarks)} landmarks"
    return Answer(values, (line + (tied if solved.anchors else ""),), refused)


@click.command("build")
@data_option
@database_options
@click.option("--method", type=click.Choice(METHODS), help="Default: anchored where anchors are, else loose.")
@click.option("--edges", type=click.Choice(EDGES), help="Default: paper; honest where anchors are tied.")
@click.option("--image-offsets/--no-image-offsets", default=True, help="Each aerial image has an offset of its own.")
@answering
def command(
    data: DataDirectory, method: Method | None, edges: Edges | None, image_offsets: bool, *, screen: Screen
) -> Answer:
    """Filter what was not filtered yet, solve a new map version, and bring the landmark database up to it."""
    with data.opened_log() as log:
        built = build_map(data, log, screen, method=method, edges=edges, image_offsets=image_offsets)
    if not built.projection.applied:
        refused = "; ".join(built_answer(built).complaints)
        raise InputError(f"the map was solved, and the landmark database did not take it: {refused or 'no reason'}")
    return built_answer(built)
