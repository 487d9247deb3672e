"""The landmark store a URL names: a GeoPackage file, or a database on a PostGIS server."""

from pathlib import Path

from trigpoint.errors import InputError
from trigpoint.landmarks.ports import LandmarkStore

GEOPACKAGE, POSTGIS = "geopackage", "postgresql+psycopg"


def geopackage_url(path: Path) -> str:
    """The URL of a GeoPackage file."""
    return f"{GEOPACKAGE}:{path}"


def geopackage_path(url: str) -> Path | None:
    """The file a URL names, None if it names no file."""
    scheme, _, rest = url.partition(":")
    return Path(rest) if scheme == GEOPACKAGE else None


def opened_store(url: str, *, password_file: Path | None = None, read_only: bool = False) -> LandmarkStore:
    """The landmark store at `geopackage:<path>` or `postgresql+psycopg://USER@HOST:PORT/DATABASE`; close it.

    A server's password comes from `password_file`, if named, else from the URL or PostgreSQL's own settings. Raises
    InputError for any other URL, and as GeoPackageStore and PostgisStore do.
    """
    scheme = url.partition(":")[0]
    path = geopackage_path(url)
    if path is not None:
        if path == Path():
            raise InputError(f"{url!r} names no file: {GEOPACKAGE}:<path> is needed")
        from trigpoint.landmarks.geopackage_store import GeoPackageStore  # SQLAlchemy: nothing for a mere URL

        return GeoPackageStore(path, read_only=read_only)
    if scheme == POSTGIS:
        from trigpoint.landmarks.postgis_store import PostgisStore  # costs half a second, which a file does not need

        return PostgisStore(url, password_file=password_file, read_only=read_only)
    raise InputError(f"database {scheme!r} is not known: {GEOPACKAGE}: and {POSTGIS}: are")
