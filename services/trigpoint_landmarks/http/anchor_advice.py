"""What would become of a label, where the next one would help most, and which ground the images show."""

from collections.abc import Awaitable, Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from trigpoint.errors import FrameRefused, InputError
from trigpoint.geodesy.projection import WGS84, transform_coordinates
from trigpoint.geodesy.uncertainty import ellipses_of
from trigpoint.landmarks.conditions import AnyOf, Compared, Given, OfFeature
from trigpoint.landmarks.feature_query import GridBox, MapState
from trigpoint.landmarks.layers import LANDMARKS, anchor_id
from trigpoint_landmarks.core.footprints import Footprint
from trigpoint_landmarks.core.label_gains import NO_IMAGE, LabelSigmas, Suggestion
from trigpoint_landmarks.core.label_preview import (
    AnchoringRule,
    KnownAnchor,
    KnownLandmark,
    LabelPreview,
    MapAround,
    Point,
    ProspectiveLabel,
    expected_place,
    previewed,
    with_waiting,
)
from trigpoint_landmarks.http.asked import Asked
from trigpoint_landmarks.http.documents import JsonObject
from trigpoint_landmarks.http.map_facts import Bounds, FactsOfMap, MapFacts
from trigpoint_landmarks.http.ports import LabelRow

REACHES_M = (40.0, 400.0, 4000.0)  # within which landmarks are looked for, one after the other
SIGMA_M, IMAGE_SIGMA_M = 0.10, 0.35  # what is usual
SIGMA_LEAST_M, SIGMA_MOST_M = 1e-4, 100.0
SUGGESTIONS, SUGGESTIONS_MOST = 20, 200
TEXT_LIMIT = 200
DEGREE_DECIMALS = 9
NO_GAINS = "The map's solve did not say what one more label would tell: the next whole solve does."
METHOD = (
    "Each landmark by itself: by how much a label tied to it lowers the summed position variance of all landmarks, by "
    "the joint covariance of map version {version}. In an image whose offset the map knows the label shares that "
    "offset; in another one it has the image's own sigma beside its own. Left out: that a label may be of another "
    "landmark."
)
NAME_OF_LANDMARK = next(one for one in LANDMARKS.properties if one.name == "landmark")
SIGNATURE_OF_LANDMARK = next(one for one in LANDMARKS.properties if one.name == "signature")


@dataclass(frozen=True, slots=True)
class AnchorAdvice:
    """Advice from what is known of a map version."""

    facts: FactsOfMap
    in_force: Callable[[], Awaitable[Sequence[LabelRow]]]  # the labels in the log

    async def association(self, asked: Asked, state: MapState, as_of: int) -> JsonObject:
        """What the next solve would do with a label; on the newest version beside the labels that wait for the next.

        Raises InputError, DatabaseUnavailable, ServiceError.
        """
        label, sigmas = _label_of(asked, state)
        facts = await self.facts.of(state, as_of)
        if facts.rule is None:
            found = LabelPreview(is_tied=False, reason=f"map version {as_of} does not say how its labels were tied")
        else:
            rows = await self.in_force() if as_of == state.newest else ()
            anchors = with_waiting(facts.anchors, _on_grid(rows, state.crs))
            around = MapAround(landmarks=(), anchors=anchors, images=facts.known_images)
            found = await self._previewed(label, around, facts.rule, (state, as_of))
        return _told(found, facts, label, sigmas)

    async def _previewed(
        self, label: ProspectiveLabel, around: MapAround, rule: AnchoringRule, at: tuple[MapState, int]
    ) -> LabelPreview:
        """The preview from all landmarks that can matter: the reach grows until it holds the nearest and the gate."""
        place = expected_place(label, around.images, rule)
        found = LabelPreview(is_tied=False, reason="")
        for reach_m in REACHES_M:
            landmarks = await self._around(place, reach_m, at, label)
            found = previewed(label, replace(around, landmarks=landmarks), rule)
            if found.corrected_m is not None and max(found.corrected_m, found.gate_m or 0.0) <= reach_m:
                return found
            if found.reason == "signature":
                return found
        return found if found.nearest else replace(found, reason=f"no landmark within {REACHES_M[-1]:g} m")

    async def _around(
        self, place: Point, reach_m: float, at: tuple[MapState, int], label: ProspectiveLabel
    ) -> list[KnownLandmark]:
        """The landmarks near a place, and those of the label's identity."""
        area = GridBox(
            easting_min_m=place[0] - reach_m,
            northing_min_m=place[1] - reach_m,
            easting_max_m=place[0] + reach_m,
            northing_max_m=place[1] + reach_m,
        )
        state, as_of = at
        found = await self.facts.landmarks(state, as_of, area=area)
        if not label.signature:
            return found
        named = Compared("=", OfFeature(SIGNATURE_OF_LANDMARK), Given(label.signature))
        there = {one.landmark for one in found}
        same = await self.facts.landmarks(state, as_of, condition=named)
        return [*found, *(one for one in same if one.landmark not in there)]

    async def suggestions(self, asked: Asked, state: MapState, as_of: int) -> JsonObject:
        """Where one more anchor would help most. Raises InputError, DatabaseUnavailable."""
        limit, sigmas = _limit_of(asked), _sigmas_of(asked)
        facts = await self.facts.of(state, as_of)
        places = await self.facts.places(state, facts)
        tied = {one.landmark for one in facts.anchors if one.landmark}
        best = facts.gains.best(limit, sigmas, images_at=lambda name: places.get(name, ()), out=tied)
        known = {one.landmark: one for one in await self._named([one.landmark for one in best], facts, state)}
        total_m2 = facts.gains.summed_variance_m2
        rows = [(one, known[one.landmark]) for one in best if one.landmark in known]
        return {
            "map_version": as_of,
            "summed_variance_m2": total_m2,
            "suggestions": [
                _suggested(rank, one, landmark, places.get(one.landmark, ()), total_m2 or 0.0)
                for rank, (one, landmark) in enumerate(rows, start=1)
            ],
            "method": NO_GAINS if total_m2 is None else METHOD.format(version=facts.gains.map_version),
        }

    async def _named(self, names: Sequence[str], facts: MapFacts, state: MapState) -> list[KnownLandmark]:
        if not names:
            return []
        each = tuple(Compared("=", OfFeature(NAME_OF_LANDMARK), Given(name)) for name in names)
        return await self.facts.landmarks(state, facts.map_version, condition=AnyOf(each))

    async def images(self, state: MapState, as_of: int) -> JsonObject:
        """The images the map knows of: their ground, and their offsets. Raises DatabaseUnavailable."""
        facts = await self.facts.of(state, as_of)
        recorded = self.facts.recorded
        names = sorted({*recorded, *facts.images, *facts.footprints})
        rows = [_image(name, facts, recorded.get(name), state.crs) for name in names]
        return {"map_version": as_of, "images": rows}


def _label_of(asked: Asked, state: MapState) -> tuple[ProspectiveLabel, LabelSigmas]:
    """The label of a question."""
    lat_deg = asked.number("lat_deg", least=-90.0, most=90.0)
    lon_deg = asked.number("lon_deg", least=-180.0, most=180.0)
    sigmas = _sigmas_of(asked)
    try:
        easting_m, northing_m = transform_coordinates(
            np.array([lon_deg]), np.array([lat_deg]), source_crs=WGS84, target_crs=state.crs
        )
    except FrameRefused as error:
        raise InputError(f"lat_deg {lat_deg:g}, lon_deg {lon_deg:g} is outside the map's grid: {error}") from error
    label = ProspectiveLabel(
        anchor=asked.text("anchor", limit=TEXT_LIMIT),
        image=asked.text("image", limit=TEXT_LIMIT),
        grid_m=(float(easting_m[0]), float(northing_m[0])),
        sigma_m=sigmas.sigma_m,
        image_sigma_m=sigmas.image_sigma_m,
        signature=asked.text("signature", limit=TEXT_LIMIT),
    )
    return label, sigmas


def _on_grid(rows: Sequence[LabelRow], crs: str) -> list[KnownAnchor]:
    """Labels of the log, tied to nothing yet."""
    if not rows:
        return []
    lon_deg, lat_deg = (np.array([getattr(one, name) for one in rows]) for name in ("lon_deg", "lat_deg"))
    easting_m, northing_m = transform_coordinates(lon_deg, lat_deg, source_crs=WGS84, target_crs=crs)
    places = zip(rows, easting_m.tolist(), northing_m.tolist(), strict=True)
    return [
        KnownAnchor(anchor=one.anchor, image=one.image, grid_m=(x, y), sigma_m=one.sigma_m, landmark="", reason="")
        for one, x, y in places
    ]


def _sigmas_of(asked: Asked) -> LabelSigmas:
    return LabelSigmas(
        sigma_m=asked.number("sigma_m", SIGMA_M, least=SIGMA_LEAST_M, most=SIGMA_MOST_M),
        image_sigma_m=asked.number("image_sigma_m", IMAGE_SIGMA_M, least=0.0, most=SIGMA_MOST_M),
    )


def _limit_of(asked: Asked) -> int:
    limit = asked.whole("limit")
    if limit is not None and not 1 <= limit <= SUGGESTIONS_MOST:
        raise InputError(f"limit {limit} is outside 1 to {SUGGESTIONS_MOST}")
    return SUGGESTIONS if limit is None else limit


def _told(found: LabelPreview, facts: MapFacts, label: ProspectiveLabel, sigmas: LabelSigmas) -> JsonObject:
    """A preview as it is answered."""
    nearest, runner_up = found.nearest, found.runner_up
    name = nearest.landmark if nearest else ""
    tied = [anchor_id(one.anchor, one.image) for one in facts.anchors if name and one.landmark == name]
    gain_m2 = facts.gains.reduction_m2(name, label.image, sigmas) if name else None
    return {
        "map_version": facts.map_version,
        "landmark": name if found.is_tied else "",
        "reason": "" if found.is_tied else found.reason,
        "distance_m": found.distance_m,
        "corrected_distance_m": found.corrected_m,
        "gate_m": found.gate_m,
        "chi_square": found.chi_square,
        "chi_square_limit": found.chi_square_limit,
        "landmark_position": list(nearest.lon_lat_deg) if nearest else None,
        "landmark_kind": nearest.kind if nearest else None,
        "runner_up": _runner_up(runner_up, found.runner_up_m) if runner_up else None,
        "already_anchored_by": tied,
        "expected_variance_reduction_m2": gain_m2 if found.is_tied else None,
        "explanation": _explained(found, name),
    }


def _runner_up(one: KnownLandmark, distance_m: float | None) -> JsonObject:
    return {
        "landmark": one.landmark,
        "distance_m": distance_m,
        "position": list(one.lon_lat_deg),
        "kind": one.kind,
    }


def _explained(found: LabelPreview, name: str) -> str:
    """A sentence for people."""
    if not found.is_tied:
        return f"The label would be tied to no landmark: {found.reason}."
    if found.corrected_m is None or found.gate_m is None:
        return f"The label would be tied to {name}, which has the same known identity."
    beside = (
        "no other landmark near" if found.runner_up_m is None else f"the next one is {found.runner_up_m:.2f} m away"
    )
    return (
        f"The label would be tied to {name}, {found.corrected_m:.2f} m from where it is expected, with a limit of "
        f"{found.gate_m:.2f} m; {beside}."
    )


def _suggested(
    rank: int, one: Suggestion, landmark: KnownLandmark, images: Sequence[str], total_m2: float
) -> JsonObject:
    return {
        "rank": rank,
        "landmark": one.landmark,
        "kind": landmark.kind,
        "position": list(landmark.lon_lat_deg),
        "sigma_major_m": landmark.sigma_major_m,
        "variance_reduction_m2": one.variance_reduction_m2,
        "share": one.variance_reduction_m2 / total_m2 if total_m2 > 0.0 else None,
        "image": "" if one.image == NO_IMAGE else one.image,
        "image_choices": list(images),
    }


def _image(name: str, facts: MapFacts, box: Bounds | None, crs: str) -> JsonObject:
    offset: Mapping[str, Any] | None = facts.images.get(name)
    ground = facts.footprints.get(name)
    major = minor = heading = None
    if offset is not None:
        ((major, minor, heading),) = ellipses_of(np.array([offset["covariance_m2"]], dtype=np.float64)).tolist()
    return {
        "image": name,
        "footprint": _box_polygon(box) if box else _polygon(ground, crs) if ground else None,
        "footprint_source": "recorded" if box else "labels" if ground else None,
        "offset_x_m": offset["offset_x_m"] if offset else None,
        "offset_y_m": offset["offset_y_m"] if offset else None,
        "sigma_major_m": major,
        "sigma_minor_m": minor,
        "ellipse_heading_rad": heading,
        "anchor_count": ground.label_count if ground else 0,
    }


def _polygon(ground: Footprint, crs: str) -> JsonObject:
    x, y = np.array(ground.outline_m(), dtype=np.float64).T
    lon_deg, lat_deg = transform_coordinates(x, y, source_crs=crs, target_crs=WGS84)
    corners = np.column_stack([lon_deg, lat_deg]).round(DEGREE_DECIMALS).tolist()
    return {"type": "Polygon", "coordinates": [corners]}


def _box_polygon(box: Bounds) -> JsonObject:
    west, south, east, north = box
    corners = [[west, south], [east, south], [east, north], [west, north], [west, south]]
    return {"type": "Polygon", "coordinates": [corners]}
