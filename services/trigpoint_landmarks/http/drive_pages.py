"""Pages of drives: they stand in the log, not in the database, and there are few."""

import json
from collections.abc import Sequence
from dataclasses import asdict

from trigpoint.landmarks.condition_truth import meets
from trigpoint.landmarks.feature_query import FeaturePage, FeatureQuery
from trigpoint.landmarks.layers import drive_id
from trigpoint_landmarks.http.ports import DriveRow


def drive_page(drives: Sequence[DriveRow], query: FeatureQuery, *, map_version: int) -> FeaturePage:
    """The drives that meet a query, in order of id; they have no geometry, so that none is in an area."""
    found = sorted((drive_id(one.vehicle, one.boot_id), one) for one in drives if _meets(one, query))
    named = [(name, one) for name, one in found if query.feature_id in (None, name)]
    rest = [(name, one) for name, one in named if query.first_id is None or name >= query.first_id]
    shown = rest[: query.limit]
    return FeaturePage(
        map_version=map_version,
        features=b",".join(_feature(name, one) for name, one in shown),
        count=len(shown),
        next_id=rest[query.limit][0] if len(rest) > query.limit else None,
    )


def _meets(drive: DriveRow, query: FeatureQuery) -> bool:
    if query.areas or (query.during is not None and not query.during.meets(drive.start_ns, drive.end_ns)):
        return False
    return meets(query.condition, lambda name: getattr(drive, name), lambda: None)


def _feature(name: str, drive: DriveRow) -> bytes:
    feature = {"type": "Feature", "id": name, "geometry": None, "properties": asdict(drive)}
    return json.dumps(feature, ensure_ascii=False).encode()
