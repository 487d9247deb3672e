"""What the log holds beside the map: drives' paths by odometry and filter, fixes with their verdicts, labels."""

import asyncio
import json
import time
from collections.abc import Callable, Hashable, Sequence
from dataclasses import asdict
from http import HTTPStatus
from typing import Any, TypeVar

import numpy as np
from starlette.responses import Response

from trigpoint.errors import InputError
from trigpoint.geodesy.projection import MapFrame, wgs84_from_map_points
from trigpoint.landmarks.layers import drive_id
from trigpoint_landmarks.core.thinning import spread, thinned
from trigpoint_landmarks.http.asked import Asked
from trigpoint_landmarks.http.documents import GEOJSON, JsonObject
from trigpoint_landmarks.http.ports import DrivenPath, JudgedFix, LabelRow, MapCorrections, MeasuredDrives, PathSource

VERTICES_MOST = 2000  # of a drive's path
FIXES_MOST = 5000
FRESH_S = 5.0  # how long what was read of the log is shown again at least
LABELS_S = 1.0  # labels are asked for with every step of a pointer
READING_SHARE = 20.0  # and so many times as long as reading it took
DEGREE_DECIMALS = 9
SOURCES: tuple[PathSource, ...] = ("odometry", "filtered")

Read = TypeVar("Read")


class LoggedDrives:
    """Answers from the log; without one there is nothing, and no error. Whatever is long to read is read by one asker
    at a time, and shown to all who ask soon after."""

    def __init__(
        self,
        drives: MeasuredDrives | None,
        corrections: MapCorrections | None,
        *,
        now_s: Callable[[], float] = time.monotonic,
    ) -> None:
        self._drives, self._corrections, self._now_s = drives, corrections, now_s
        self._one_at_a_time = asyncio.Lock()
        self._labels: tuple[float, Sequence[LabelRow]] = (float("-inf"), ())  # until when, and which
        self._held: dict[Hashable, tuple[float, Any]] = {}  # until when, and what

    async def paths(self, asked: Asked, map_version: int | None) -> Response:
        """Drives' paths. Raises InputError, ServiceError."""
        source = next((one for one in SOURCES if one == asked.parameters.get("source")), None)
        if source is None:
            raise InputError(f"source {asked.parameters.get('source', '')[:40]!r}: there are {', '.join(SOURCES)}")
        features = await self._read(source, lambda: _path_features(self._drives, source))
        return _collection([one for one in features if _is_of(one, asked)], {"map_version": map_version})

    async def fixes(self, asked: Asked, map_version: int | None) -> Response:
        """Fixes and what the filter said of them. Raises InputError, ServiceError."""
        accepted = asked.parameters.get("accepted")
        if accepted not in (None, "true", "false"):
            raise InputError(f"accepted {accepted[:40]!r}: true or false is needed")
        fixes = await self._read("fixes", lambda: () if self._drives is None else self._drives.fixes())
        chosen = [
            one
            for one in fixes
            if accepted in (None, "true" if one.accepted else "false")
            and asked.parameters.get("drive") in (None, drive_id(one.vehicle, one.boot_id))
        ]
        chosen.sort(key=lambda one: one.stamp_ns)
        shown = [chosen[number] for number in spread(len(chosen), most=FIXES_MOST)] if chosen else []
        counts = {"map_version": map_version, "numberMatched": len(chosen), "numberReturned": len(shown)}
        return _collection([_fix_feature(one) for one in shown], counts)

    async def in_force(self) -> Sequence[LabelRow]:
        """The labels in force as they were `LABELS_S` ago at most. Raises ServiceError."""
        if self._now_s() >= self._labels[0]:
            await self._look_for_labels()
        return self._labels[1]

    async def _look_for_labels(self) -> None:
        corrections = self._corrections
        rows = () if corrections is None else await asyncio.to_thread(corrections.labels)
        self._labels = (self._now_s() + LABELS_S, rows)

    async def labels(self) -> JsonObject:
        """The labels in force now. Raises ServiceError."""
        await self._look_for_labels()
        told = []
        for one in self._labels[1]:
            values = asdict(one)
            position = [values.pop("lon_deg"), values.pop("lat_deg")]
            told.append({**values, "position": position})
        return {"labels": told}

    async def _read(self, key: Hashable, reading: Callable[[], Read]) -> Read:
        async with self._one_at_a_time:
            held = self._held.get(key)
            if held is None or self._now_s() >= held[0]:
                began_s = self._now_s()
                found = await asyncio.to_thread(reading)
                cost_s = self._now_s() - began_s
                held = self._held[key] = (self._now_s() + max(FRESH_S, READING_SHARE * cost_s), found)
        read: Read = held[1]
        return read


def _path_features(drives: MeasuredDrives | None, source: PathSource) -> list[JsonObject]:
    frame = None if drives is None else drives.frame()
    if drives is None or frame is None:
        return []
    return [_path_feature(one, source, frame) for one in drives.paths(source) if len(one.stamp_ns) > 1]


def _path_feature(path: DrivenPath, source: PathSource, frame: MapFrame) -> JsonObject:
    lat_deg, lon_deg = wgs84_from_map_points(thinned(path.point_m, most=VERTICES_MOST), frame)
    return {
        "type": "Feature",
        "id": f"{source}:{drive_id(path.vehicle, path.boot_id)}",
        "geometry": {
            "type": "LineString",
            "coordinates": np.column_stack([lon_deg, lat_deg]).round(DEGREE_DECIMALS).tolist(),
        },
        "properties": {
            "source": source,
            "vehicle": path.vehicle,
            "boot_id": path.boot_id,
            "first_stamp_ns": int(path.stamp_ns[0]),
            "last_stamp_ns": int(path.stamp_ns[-1]),
            "pose_count": len(path.stamp_ns),
            "length_m": float(np.hypot(*np.diff(path.point_m, axis=0).T).sum()),
        },
    }


def _fix_feature(one: JudgedFix) -> JsonObject:
    properties = asdict(one)
    position = [properties.pop("lon_deg"), properties.pop("lat_deg")]
    return {
        "type": "Feature",
        "id": f"{drive_id(one.vehicle, one.boot_id)}:{one.fix_sequence}",
        "geometry": {"type": "Point", "coordinates": position},
        "properties": properties,
    }


def _is_of(feature: JsonObject, asked: Asked) -> bool:
    """Whether a path is of the drive asked for, if one is."""
    told = feature["properties"]
    return asked.parameters.get("drive") in (None, drive_id(told["vehicle"], told["boot_id"]))


def _collection(features: Sequence[JsonObject], more: JsonObject) -> Response:
    content = json.dumps({"type": "FeatureCollection", **more, "features": features}, ensure_ascii=False)
    return Response(content.encode(), HTTPStatus.OK, {"Cache-Control": "no-cache"}, GEOJSON)
