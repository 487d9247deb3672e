"""Answers worked out from rows a store has found: what meets a query, in its order, and what changed between two."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from operator import attrgetter, itemgetter
from typing import Protocol

import numpy as np

from trigpoint.errors import InputError
from trigpoint.geodesy.projection import geodesic_distances_m
from trigpoint.landmarks.model import Landmark, LandmarkChanges, changes_between
from trigpoint.landmarks.queries import Disc, LandmarkQuery, Nearest, PageMark, require_known_version, require_whole

WIDENING_M = (64.0, 256.0, 1_024.0, 4_096.0, 16_384.0, 65_536.0)  # discs in which the nearest are looked for

_ID = attrgetter("landmark")

Find = Callable[[LandmarkQuery], Sequence[Landmark]]
Ranked = tuple[float, str, Landmark]  # in the order of an answer: by distance in m, else 0, then by id


def answer_of(find: Find, query: LandmarkQuery) -> tuple[Landmark, ...]:
    """The answer to a query; `find` gives the landmarks that meet a query's version, and at least nearly the rest.

    The nearest are looked for in ever wider discs, until one holds enough of them.
    """
    if query.nearest is None:
        return answered(find(query), query)
    whole = replace(query, limit=None, after=None)
    for radius_m in WIDENING_M:
        around = _around(whole, query.nearest, radius_m)
        found = answered(find(around), around)
        if len(found) >= query.nearest.count:
            return answered(found, query)
    return answered(find(replace(whole, nearest=None)), query)


def answered(found: Sequence[Landmark], query: LandmarkQuery) -> tuple[Landmark, ...]:
    """The answer to a query from landmarks of its version, among them all that meet it."""
    ranked = _ranked([landmark for landmark in found if _meets(landmark, query)], query)
    if query.after is not None:
        mark = (query.after.distance_m or 0.0, query.after.landmark)
        ranked = [one for one in ranked if (one[0], one[1]) > mark]
    return tuple(landmark for _, _, landmark in ranked[: query.limit])


def mark_of(landmark: Landmark, query: LandmarkQuery) -> PageMark:
    """Where the answer to a query stands at a landmark of it."""
    if not query.by_distance:
        return PageMark(landmark=landmark.landmark)
    (distance_m,) = _distances_m([landmark], query)
    return PageMark(landmark=landmark.landmark, distance_m=distance_m)


def _around(query: LandmarkQuery, nearest: Nearest, radius_m: float) -> LandmarkQuery:
    disc = Disc(lat_deg=nearest.lat_deg, lon_deg=nearest.lon_deg, radius_m=radius_m)
    return replace(query, nearest=None, near=disc)


def _meets(landmark: Landmark, query: LandmarkQuery) -> bool:
    """Whether a landmark meets every condition but distance and version."""
    if query.bbox is not None and not query.bbox.contains(landmark.lat_deg, landmark.lon_deg):
        return False
    if query.kinds and landmark.kind not in query.kinds:
        return False
    if query.max_sigma_m is not None and not landmark.sigma_major_m <= query.max_sigma_m:
        return False
    if query.vehicle is not None and query.vehicle not in landmark.vehicles:
        return False
    return query.seen is None or query.seen.meets(landmark.first_seen_ns, landmark.last_seen_ns)


def _ranked(landmarks: list[Landmark], query: LandmarkQuery) -> list[Ranked]:
    """The landmarks in the order of the answer: those within the disc, or the nearest."""
    if not query.by_distance:
        return [(0.0, landmark.landmark, landmark) for landmark in sorted(landmarks, key=_ID)]
    pairs = zip(_distances_m(landmarks, query), landmarks, strict=True)
    ranked = sorted(((distance_m, row.landmark, row) for distance_m, row in pairs), key=itemgetter(0, 1))
    if query.near is not None:
        radius_m = query.near.radius_m
        return [one for one in ranked if one[0] <= radius_m]
    return ranked if query.nearest is None else ranked[: query.nearest.count]


def _distances_m(landmarks: Sequence[Landmark], query: LandmarkQuery) -> list[float]:
    """How far each landmark is from the position that is asked for, in true metres."""
    place = query.near or query.nearest
    if place is None or not landmarks:
        return []
    lat_deg = np.array([landmark.lat_deg for landmark in landmarks])
    lon_deg = np.array([landmark.lon_deg for landmark in landmarks])
    distance_m = geodesic_distances_m(place.lat_deg, place.lon_deg, lat_deg=lat_deg, lon_deg=lon_deg)
    return [float(one_m) for one_m in distance_m]


class Differing(Protocol):
    """A store's rows that two versions do not have in common, among those that meet a query at least nearly."""

    def known_versions(self, around: int) -> Sequence[int]:
        """The numbers of the first version, of this one if it is there, and of the newest, in order."""

    def ended(self, query: LandmarkQuery, *, since: int, as_of: int) -> Sequence[Landmark]:
        """Rows valid at version `since`, and not any more at `as_of`."""

    def opened(self, query: LandmarkQuery, *, since: int, as_of: int) -> Sequence[Landmark]:
        """Rows valid at version `as_of`, and not yet at `since`."""


def changes_of(store: Differing, query: LandmarkQuery, *, since: int) -> LandmarkChanges:
    """The changes a store answers. Raises InputError as `LandmarkStore.changes`."""
    for name, value in (("limit", query.limit), ("after", query.after), ("nearest", query.nearest)):
        if value is not None:
            raise InputError(f"{name} {value} cannot go with changes since version {since}: they are whole or wrong")
    require_whole("since", since)
    known = store.known_versions(since)
    require_known_version(since, known)
    as_of = known[-1] if query.as_of is None else query.as_of
    require_known_version(as_of, store.known_versions(as_of))
    if since > as_of:
        raise InputError(f"changes since version {since} up to {as_of}: the first has to be the older one")
    before = answered(store.ended(query, since=since, as_of=as_of), query)
    after = answered(store.opened(query, since=since, as_of=as_of), query)
    return changes_between(before, after, since=since, as_of=as_of)
