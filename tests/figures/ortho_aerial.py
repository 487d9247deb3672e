"""The ortho layer of a campus beside its own aerial pictures, and a map that those pictures alone tie to the ground."""

import shutil
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from typing import Any

from aerial_campus.driving import DrivenCampus, driven_campus
from aerial_campus.misfits import Misfits, misfits
from aerial_campus.true_layer import render_true_layer
from figures.figure import Bounds, Figure, Measurement, at_most
from figures.workbench import Workbench
from trigpoint.events.truth import truth_from_lines
from trigpoint_tiles.settings import TilesSettings

SEED = 1
PERCEIVED, LABELLED, LOOSE = "aerial/perceived", "aerial/labelled", "aerial/loose"
DESKEWED = {True: "deskewed", False: "without deskew"}
LATERAL_M, LONGITUDINAL_M = at_most(0.15), at_most(0.25)
REACH_M = 6.0  # a map of fixes alone is off by as much


@dataclass(frozen=True, slots=True, kw_only=True)
class Layer:
    """An ortho layer's name, and whether it is of the true path; deskewed or not."""

    name: str
    true: bool
    deskew: bool


TRUE, TRUE_SKEWED = Layer(name="true", true=True, deskew=True), Layer(name="true-skewed", true=True, deskew=False)
MAPPED, MAPPED_SKEWED = Layer(name="map", true=False, deskew=True), Layer(name="map-skewed", true=False, deskew=False)


@cache
def driven(folder: Path) -> DrivenCampus:
    """The drive, once a run."""
    return driven_campus(folder / "aerial", seed=SEED)


def perceived(bench: Workbench, data: str) -> Path:
    """A data directory of the drive with what was perceived in it."""
    found, copy = Path(bench.path(PERCEIVED)), Path(bench.path(data))
    written = driven(bench.folder).written
    bench.run("ingest", *map(str, written.logs), "--data", str(found))
    bench.run("perceive", "--data", str(found))
    if not copy.exists():
        shutil.copytree(found, copy)
    return copy


def labelled_map(bench: Workbench) -> dict[str, Sequence[float]]:
    """A map anchored by labels in the pictures, and each picture's offset as it was solved."""
    data, anchors = perceived(bench, LABELLED), driven(bench.folder).written.anchors
    bench.run("anchors", "import", str(anchors), "--data", str(data))
    answer = bench.run("build", "--data", str(data), "--method", "anchored", "--json").answer
    return {image: one["offset_m"] for image, one in answer["image_offsets"].items()}


def layer_file(bench: Workbench, layer: Layer) -> Path:
    """The layer's raster."""
    labelled_map(bench)
    out = Path(bench.path(f"aerial/{layer.name}"))
    if not layer.true:
        words = () if layer.deskew else ("--no-deskew",)
        bench.run("ortho", "render", "--data", bench.path(LABELLED), "--out", str(out), "--format", "cog", *words)
        return out / "ortho.tif"
    file, truth = out.with_suffix(".tif"), driven(bench.folder).written.truth
    if not file.exists() and truth is not None:
        settings = TilesSettings(deskew=layer.deskew)
        render_true_layer(Path(bench.path(LABELLED)) / "log", truth, file, settings)
    return file


def tiles_of(bench: Workbench, layer: Layer) -> Mapping[str, Sequence[Mapping[str, Any]]]:
    """What each picture's tiles say, by picture."""
    file = layer_file(bench, layer)
    found = {}
    for one in driven(bench.folder).pictures:
        outcome = bench.run("ortho", "register", "--ortho", str(file), "--image", str(one.folder), "--json")
        found[one.image] = outcome.answer["tiles"]["items"]
    return found


def laid_beside(bench: Workbench, layer: Layer, *, solved: bool) -> Misfits:
    """The layer beside the pictures, each less its own offset: as the map solved it, or as it truly is."""
    known, truth = driven(bench.folder), driven(bench.folder).written.truth
    assert truth is not None
    with truth.open(encoding="utf-8") as lines:
        (path,) = truth_from_lines(lines).paths
    tiles, offset_m = tiles_of(bench, layer), labelled_map(bench)
    if solved:
        tiles = {image: items for image, items in tiles.items() if image in offset_m}
    else:
        offset_m = {image: known.offset_m(image) for image in tiles}
    return misfits(tiles, offset_m, path, crs=known.campus.frame.crs)


def of_layer(bench: Workbench, *, layer: Layer, solved: bool, value: Callable[[Misfits], float]) -> Measurement:
    """A number of a layer beside the pictures."""
    measured = value(laid_beside(bench, layer, solved=solved))
    words = "" if layer.deskew else " --no-deskew"
    made = "aerial_campus.true_layer.render_true_layer" if layer.true else f"trigpoint ortho render{words}"
    return Measurement(value=measured, command=f"{made}; trigpoint ortho register, each of the campus's pictures")


def tied_by_pictures(bench: Workbench, times: int) -> Path:
    """A data directory whose newest map is of fixes alone (0 times), or anchored by what was measured in all pictures
    on the map before it, so many times one after the other."""
    if times == 0:
        data = perceived(bench, LOOSE)
        bench.run("build", "--data", str(data), "--method", "loose")
        return data
    before, data = tied_by_pictures(bench, times - 1), Path(bench.path(f"aerial/tied-{times}"))
    if data.exists():
        return data
    out = Path(bench.path(f"aerial/layer-{times}"))
    bench.run("ortho", "render", "--data", str(before), "--out", str(out), "--format", "cog")
    shutil.copytree(before, data)
    for one in driven(bench.folder).pictures:
        words = ("--ortho", str(out / "ortho.tif"), "--image", str(one.folder), "--reach-m", REACH_M)
        bench.run("ortho", "anchors", "--data", str(data), *words)
    bench.run("build", "--data", str(data), "--method", "anchored")
    return data


def of_tied(bench: Workbench, *, times: int, at: str) -> Measurement:
    """A number of the map that pictures tie."""
    data, truth = tied_by_pictures(bench, times), driven(bench.folder).written.truth
    outcome = bench.run("evaluate", "truth", "--data", str(data), "--truth", str(truth), "--json")
    return Measurement(value=outcome.at(at), command=outcome.command)


def _beside(
    name: str, layer: Layer, value: Callable[[Misfits], float], *, solved: bool = False, target: Bounds | None = None
) -> Figure:
    measure = partial(of_layer, layer=layer, solved=solved, value=value)
    return Figure(name=f"{name}, {DESKEWED[layer.deskew]}", unit="m", target=target, measure=measure)


def _tied(name: str, unit: str, times: int, at: str) -> Figure:
    return Figure(name=name, unit=unit, target=None, measure=partial(of_tied, times=times, at=at))


def _lateral(found: Misfits) -> float:
    return found.lateral_rms_m


def _longitudinal(found: Misfits) -> float:
    return found.longitudinal_rms_m


OF_MAP = "campus, the anchored map's ortho beside the aerial pictures as it took them"
OF_GROUND = "campus, the anchored map's ortho beside the true ground"
OF_TRUTH = "campus, the ortho of the true path beside the true ground"
FIGURES = (
    _beside(f"{OF_MAP}: lateral", MAPPED, _lateral, solved=True, target=LATERAL_M),
    _beside(f"{OF_MAP}: longitudinal", MAPPED, _longitudinal, solved=True, target=LONGITUDINAL_M),
    _beside(f"{OF_MAP}: lateral", MAPPED_SKEWED, _lateral, solved=True),
    _beside(f"{OF_MAP}: longitudinal", MAPPED_SKEWED, _longitudinal, solved=True),
    _beside(f"{OF_GROUND}: lateral", MAPPED, _lateral),
    _beside(f"{OF_GROUND}: longitudinal", MAPPED, _longitudinal),
    _beside(f"{OF_TRUTH}: lateral", TRUE, _lateral, target=LATERAL_M),
    _beside(f"{OF_TRUTH}: longitudinal", TRUE, _longitudinal, target=LONGITUDINAL_M),
    _beside(f"{OF_TRUTH}: lateral", TRUE_SKEWED, _lateral),
    _beside(f"{OF_TRUTH}: longitudinal", TRUE_SKEWED, _longitudinal),
    Figure(
        name="tiles of one street's direction that tell, of the true path's",
        unit="1",
        target=None,
        measure=partial(of_layer, layer=TRUE, solved=False, value=lambda found: len(found.lateral_m)),
    ),
    _tied("campus, map of fixes alone: path error, RMSE", "m", 0, "trajectory.error_m.rmse"),
    _tied("tied by what was measured in the pictures: path error, RMSE", "m", 1, "trajectory.error_m.rmse"),
    _tied("the same: landmark error, mean", "m", 1, "error_m.mean"),
    _tied("the same: NEES of each landmark", "per axis", 1, "nees_per_dof_each"),
    _tied("measured again on that map: landmark error, mean", "m", 2, "error_m.mean"),
    _tied("measured again on that map: NEES of each landmark", "per axis", 2, "nees_per_dof_each"),
)
