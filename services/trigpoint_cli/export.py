"""`trigpoint export`: the map as files of other GIS programs."""

import asyncio
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from importlib.metadata import version as installed_version
from pathlib import Path
from typing import Any

import click

from trigpoint.errors import InputError
from trigpoint.landmarks.conditions import AllOf, Compared, Condition, Given, OfFeature
from trigpoint.landmarks.cql2_conditions import condition_from_text
from trigpoint.landmarks.feature_crs import CRS84, FeatureCrs
from trigpoint.landmarks.layers import DRIVES, LANDMARKS, LAYERS, Layer
from trigpoint.landmarks.model import MapVersion
from trigpoint.landmarks.queries import require_known_version
from trigpoint_cli.data_dir import DataDirectory, as_of_option, data_option
from trigpoint_cli.database import database_options, database_settings
from trigpoint_cli.export_qgis import qgis
from trigpoint_cli.feature_source import opened_source
from trigpoint_cli.output import Answer, Screen, answering, counted
from trigpoint_cli.serving.map_corrections import LoggedCorrections
from trigpoint_landmarks.core.questions import bbox_of
from trigpoint_landmarks.export.export import Export
from trigpoint_landmarks.export.formats import FORMATS, Format, write_file
from trigpoint_landmarks.export.placed import crs_of, map_crs_of
from trigpoint_landmarks.export.provenance import provenance_of
from trigpoint_landmarks.export.reading import Batch, MapReading, Selection
from trigpoint_landmarks.http.ports import DriveRow


@click.group("export", help="The map as files of other GIS programs, or as a QGIS project.")
def command() -> None:
    """Group of the formats."""


command.add_command(qgis)


def _export_command(form: Format) -> Callable[..., None]:
    @command.command(form.name, help=f"Write {form.title}; all of one map version.")
    @data_option
    @database_options
    @click.option("--out", required=True, metavar="FILE", type=click.Path(path_type=Path, dir_okay=False))
    @click.option("--layer", "names", multiple=True, type=click.Choice(list(LAYERS)), help="This layer, or several.")
    @as_of_option
    @click.option("--crs", metavar="EPSG:CODE", help=f"{'WGS 84' if form.degrees else 'The map’s own'} by default.")
    @click.option("--bbox", metavar="LON_MIN,LAT_MIN,LON_MAX,LAT_MAX", help="Only inside this box, in degrees.")
    @click.option("--filter", "cql2", metavar="CQL2", help="Only what meets this, as over HTTP; goes with one layer.")
    @click.option("--max-sigma-m", type=float, metavar="S", help="Only landmarks whose ellipse is at most so long.")
    @click.option("--force", is_flag=True, help="Replace a file that is there.")
    @answering
    def export(data: DataDirectory, out: Path, *, force: bool, screen: Screen, **asked: Any) -> Answer:
        layers = _layers(form, asked["names"], data)
        selection = Selection(
            box=None if asked["bbox"] is None else bbox_of(asked["bbox"]),
            conditions=_conditions(layers, asked["cql2"], asked["max_sigma_m"]),
        )
        with _reading(data, asked["as_of"]) as reading, screen.counting("exporting", unit="features") as progress:
            crs = _crs(form, asked["crs"], reading.version)

            def batches(layer: Layer) -> Iterator[Batch]:
                for batch in reading.batches(layer, crs, selection):
                    yield batch
                    progress(len(batch))

            generator = f"trigpoint {installed_version('trigpoint')}"
            provenance = provenance_of(reading.version, crs, reading.seen(), generator=generator)
            written = Export(provenance, crs, layers, batches)
            files = _written(form, out, written, force=force)
        return _answer(form, files, written)

    return export


for _form in FORMATS.values():
    _export_command(_form)


def _layers(form: Format, names: Sequence[str], data: DataDirectory) -> tuple[Layer, ...]:
    """The layers that are asked for; of several a file can hold all there are, in one that holds one the landmarks."""
    if form.one_layer and len(set(names)) > 1:
        raise InputError(f"{form.name} holds one layer a file: --layer says {', '.join(names)}")
    if names:
        return tuple(LAYERS[name] for name in dict.fromkeys(names))
    if form.one_layer:
        return (LANDMARKS,)
    return tuple(layer for layer in LAYERS.values() if layer is not DRIVES or data.log.is_dir())


def _conditions(layers: Sequence[Layer], cql2: str | None, max_sigma_m: float | None) -> dict[str, Condition]:
    """The condition of each layer that has one."""
    parts: list[Condition] = []
    if cql2 is not None:
        if len(layers) != 1:
            raise InputError(f"--filter goes with one layer: --layer leaves {len(layers)}, of different properties")
        parts.append(condition_from_text(cql2, layers[0]))
    if max_sigma_m is not None:
        sigma = LANDMARKS.property_named("sigma_major_m")
        if LANDMARKS not in layers or sigma is None:
            raise InputError(f"--max-sigma-m {max_sigma_m:g} is of landmarks: they are not among the layers")
        parts.append(Compared("<=", OfFeature(sigma), Given(max_sigma_m)))
    if not parts:
        return {}
    (layer,) = layers if cql2 is not None else (LANDMARKS,)
    return {layer.name: parts[0] if len(parts) == 1 else AllOf(tuple(parts))}


def _crs(form: Format, asked: str | None, version: MapVersion) -> FeatureCrs:
    if asked is None:
        return CRS84 if form.degrees else map_crs_of(version.crs)
    crs = crs_of(asked)
    if form.degrees_only and not crs.is_wgs84:
        raise InputError(f"--crs {asked}: {form.name} is always on WGS 84")
    return crs


@contextmanager
def _reading(data: DataDirectory, as_of: int | None) -> Iterator[MapReading]:
    """The map version that is asked for. Raises InputError where there is none."""
    with data.opened_database(read_only=True) as store:
        versions = store.map_versions()
    if not versions:
        raise InputError("the map has no version yet: there is nothing to export")
    if as_of is not None:
        require_known_version(as_of, [one.map_version for one in versions])
    version = next((one for one in versions if one.map_version == as_of), versions[-1])
    drives = _drives(data)
    chosen = database_settings(data.path, data.asked)
    with asyncio.Runner() as runner:
        source = opened_source(chosen.url, password_file=chosen.password_file, connections=1)
        try:
            yield MapReading(source, runner, version, drives)
        finally:
            runner.run(source.close())


def _drives(data: DataDirectory) -> Sequence[DriveRow] | None:
    return LoggedCorrections(data).drives() if data.log.is_dir() else None


def _written(form: Format, out: Path, export: Export, *, force: bool) -> tuple[Path, ...]:
    try:
        return write_file(form, out, export, force=force)
    except OSError as error:
        raise InputError(f"{out}: cannot be written: {error.strerror}") from error


def _answer(form: Format, files: Sequence[Path], export: Export) -> Answer:
    sizes = {str(file): file.stat().st_size for file in files}
    provenance = export.provenance
    values = {
        "format": form.name,
        "features": export.counts,
        "files": [{"path": path, "size_bytes": size} for path, size in sizes.items()],
        "size_bytes": sum(sizes.values()),
        **provenance.values(),
    }
    epoch = "" if provenance.coordinate_epoch is None else f", epoch {provenance.coordinate_epoch:.3f}"
    lines = (
        f"{files[0]}: map version {provenance.map_version} in {provenance.crs}{epoch}",
        *(f"  {name}: {counted(count, 'feature')}" for name, count in export.counts.items()),
    )
    return Answer(values, lines)
