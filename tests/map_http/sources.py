"""Landmark databases of both kinds with given versions in them."""

from collections.abc import Iterable
from contextlib import closing
from pathlib import Path

import pytest

from landmark_maps.examples import checkpoint
from trigpoint.landmarks.feature_query import FeatureSource
from trigpoint.landmarks.geopackage_features import GeoPackageFeatures
from trigpoint.landmarks.geopackage_store import GeoPackageStore
from trigpoint.landmarks.model import MapChange
from trigpoint.landmarks.ports import LandmarkStore
from trigpoint.landmarks.postgis_features import PostgisFeatures
from trigpoint.landmarks.postgis_store import PostgisStore


def filled_source(
    request: pytest.FixtureRequest, folder: Path, patch: pytest.MonkeyPatch, versions: Iterable[MapChange]
) -> FeatureSource:
    """The versions in a database of the kind that is the request's parameter."""
    if request.param == "geopackage":
        path = folder / "map.gpkg"
        store: LandmarkStore = GeoPackageStore(path)
        source: FeatureSource = GeoPackageFeatures(path)
    else:
        cluster = request.getfixturevalue("postgis")
        patch.setenv("PGPASSFILE", str(cluster.password_table))
        url = cluster.url(cluster.created())
        store, source = PostgisStore(url), PostgisFeatures(url)
    with closing(store):
        for number, change in enumerate(versions):
            store.apply(change, checkpoint(number + 1))
    return source
