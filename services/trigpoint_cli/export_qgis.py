"""`trigpoint export qgis`: a project that opens the live service, or an exported GeoPackage, styled."""

from pathlib import Path
from typing import Any

import click

from trigpoint.durable_files import replace_durably
from trigpoint.errors import InputError
from trigpoint_cli.output import Answer, Screen, answering
from trigpoint_landmarks.export.qgis_project import Project, project_file
from trigpoint_landmarks.export.qgis_sources import project_of_geopackage, project_of_service

SUFFIXES = (".qgs", ".qgz")


@click.command("qgis")
@click.option("--server", metavar="URL", help="The HTTP service, which is asked for the map's CRS and place.")
@click.option("--gpkg", metavar="FILE", type=click.Path(path_type=Path), help="A file of `trigpoint export gpkg`.")
@click.option("--out", required=True, metavar="FILE.qgz|FILE.qgs", type=click.Path(path_type=Path, dir_okay=False))
@click.option(
    "--token-file", metavar="FILE", type=click.Path(path_type=Path), help="A file that holds a token to ask by."
)
@click.option("--authcfg", default="", metavar="ID", help="The id under which QGIS keeps the service's token.")
@click.option("--force", is_flag=True, help="Replace a file that is there.")
@answering
def qgis(server: str | None, gpkg: Path | None, out: Path, *, force: bool, screen: Screen, **access: Any) -> Answer:
    """Write a QGIS project of the live service or of an exported GeoPackage, in the map's own CRS."""
    if (server is None) == (gpkg is None):
        raise click.UsageError("say either --server or --gpkg")
    if out.suffix not in SUFFIXES:
        raise InputError(f"{out}: a QGIS project ends with {' or '.join(SUFFIXES)}")
    if out.exists() and not force:
        raise InputError(f"{out} is there already: --force replaces it")
    project = _of_service(server, **access) if gpkg is None else project_of_geopackage(gpkg, beside=out.parent)
    content = project_file(project, name=f"{out.stem}.qgs", zipped=out.suffix == ".qgz")
    try:
        replace_durably(out, content)
    except OSError as error:
        raise InputError(f"{out}: cannot be written: {error.strerror}") from error
    layers = [one.name for one in project.layers]
    values = {"path": str(out), "title": project.title, "crs": project.map_crs, "layers": layers}
    return Answer(values, (f"{out}: {project.title} in {project.map_crs}: {', '.join(layers)}",))


def _of_service(server: str | None, *, token_file: Path | None, authcfg: str) -> Project:
    assert server is not None
    if authcfg and not (authcfg.isascii() and authcfg.isalnum()):
        raise InputError(f"authcfg {authcfg[:40]!r}: letters and digits only")
    return project_of_service(server, token=_token(token_file), authcfg=authcfg)


def _token(path: Path | None) -> str:
    if path is None:
        return ""
    try:
        return path.read_text(encoding="ascii").strip()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"token file {path}: cannot be read: {error}") from error
