"""The landmark database of a URL, to be asked for features page by page."""

from pathlib import Path

from trigpoint.landmarks.feature_query import FeatureSource
from trigpoint.landmarks.opening import geopackage_path


def opened_source(url: str, *, password_file: Path | None, connections: int) -> FeatureSource:
    """The source; it connects when it is asked. Raises InputError."""
    path = geopackage_path(url)
    if path is not None:
        from trigpoint.landmarks.geopackage_features import GeoPackageFeatures

        return GeoPackageFeatures(path)
    from trigpoint.landmarks.postgis_features import PostgisFeatures  # costs half a second a file does not need

    return PostgisFeatures(url, password_file=password_file, connections=connections)
