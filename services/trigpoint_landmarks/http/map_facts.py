"""What is looked up of a map version once and asked for often: its anchors, images, rule and gains."""

import json
from collections import OrderedDict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from trigpoint.anchoring.association import AssociationLimits
from trigpoint.landmarks.conditions import Condition
from trigpoint.landmarks.feature_query import PAGE_MOST, FeatureQuery, FeatureSource, GridBox, MapState, VersionSummary
from trigpoint.landmarks.layers import ANCHORS, IMAGE_OFFSETS, LANDMARKS, Layer
from trigpoint.landmarks.queries import DegreeBox
from trigpoint_landmarks.core.footprints import Footprint, label_footprints
from trigpoint_landmarks.core.label_gains import MapGains
from trigpoint_landmarks.core.label_preview import AnchoringRule, KnownAnchor, KnownImage, KnownLandmark

HISTORY_MOST = 1000  # versions
HELD_MOST = 4  # versions whose facts are held

Properties = Mapping[str, Any]
Area = GridBox | DegreeBox
Bounds = tuple[float, float, float, float]  # west, south, east, north in degrees


@dataclass(frozen=True)
class MapFacts:
    """A version's labels and images, how it ties labels, and what one more would tell."""

    map_version: int
    rule: AnchoringRule | None
    anchors: tuple[KnownAnchor, ...]
    images: Mapping[str, Properties]
    gains: MapGains

    @cached_property
    def known_images(self) -> Mapping[str, KnownImage]:
        """The images' offsets."""
        return {name: _known_image(properties) for name, properties in self.images.items()}

    @cached_property
    def footprints(self) -> Mapping[str, Footprint]:
        """Where each image's labels lie."""
        return label_footprints(self.anchors)


class FactsOfMap:
    """The facts of the versions that were asked for last, and the newest versions' summaries."""

    def __init__(self, source: FeatureSource, recorded: Mapping[str, Bounds]) -> None:
        self._source = source
        self.recorded = recorded  # bounds of images, where they are known and need not be told from labels
        self._held: OrderedDict[int, MapFacts] = OrderedDict()
        self._history: tuple[int, tuple[VersionSummary, ...]] = (0, ())
        self._gains: MapGains | None = None
        self._places: tuple[int, Mapping[str, Sequence[str]]] = (0, {})

    async def history(self, state: MapState) -> tuple[VersionSummary, ...]:
        """The newest versions, in order. Raises DatabaseUnavailable."""
        if self._history[0] != state.newest:
            self._history = (state.newest, await self._source.history(HISTORY_MOST))
        return self._history[1]

    async def of(self, state: MapState, as_of: int) -> MapFacts:
        """What is known of a version that is there. Raises DatabaseUnavailable."""
        held = self._held.get(as_of)
        if held is None:
            held = self._held[as_of] = await self._looked_up(state, as_of)
            while len(self._held) > HELD_MOST:
                self._held.popitem(last=False)
        return held

    async def landmarks(
        self,
        state: MapState,
        as_of: int,
        *,
        area: Area | None = None,
        condition: Condition | None = None,
    ) -> list[KnownLandmark]:
        """The landmarks of a version in an area that meet a condition. Raises DatabaseUnavailable."""
        found = await self._features(state, LANDMARKS, as_of, area=area, condition=condition)
        return [known_landmark(feature) for feature in found]

    async def places(self, state: MapState, facts: MapFacts) -> Mapping[str, Sequence[str]]:
        """On which of the images' ground each landmark is. Raises DatabaseUnavailable."""
        if self._places[0] != facts.map_version:
            self._places = (facts.map_version, await self._looked_for(state, facts))
        return self._places[1]

    async def _looked_for(self, state: MapState, facts: MapFacts) -> Mapping[str, Sequence[str]]:
        found: dict[str, list[str]] = {}
        for image in sorted({*facts.footprints, *self.recorded}):
            for one in await self._on_ground(image, state, facts):
                found.setdefault(one.landmark, []).append(image)
        return found

    async def _on_ground(self, image: str, state: MapState, facts: MapFacts) -> list[KnownLandmark]:
        """The landmarks on an image's ground."""
        if image in self.recorded:
            west, south, east, north = self.recorded[image]
            shown = DegreeBox(lon_min_deg=west, lat_min_deg=south, lon_max_deg=east, lat_max_deg=north)
            return await self.landmarks(state, facts.map_version, area=shown)
        ground = facts.footprints[image]
        west, south, east, north = ground.ground.bounds
        area = GridBox(easting_min_m=west, northing_min_m=south, easting_max_m=east, northing_max_m=north)
        near = await self.landmarks(state, facts.map_version, area=area)
        return [one for one in near if ground.holds(one.grid_m)]

    async def _looked_up(self, state: MapState, as_of: int) -> MapFacts:
        anchors = await self._features(state, ANCHORS, as_of)
        images = await self._features(state, IMAGE_OFFSETS, as_of)
        return MapFacts(
            map_version=as_of,
            rule=_rule_of(await self._source.settings_json(as_of)),
            anchors=tuple(_known_anchor(one["properties"]) for one in anchors if one["geometry"] is not None),
            images={str(one["id"]): one["properties"] for one in images},
            gains=await self._gains_of(state, as_of),
        )

    async def _gains_of(self, state: MapState, as_of: int) -> MapGains:
        """The gains of the newest whole version up to this one; most versions say only what differs from one."""
        whole = [one.map_version for one in await self.history(state) if one.base_version == 0]
        at = max((number for number in whole if number <= as_of), default=None)
        if self._gains is None or at is None or self._gains.map_version != at:
            self._gains = MapGains(await self._source.label_gains(as_of))
        return self._gains

    async def _features(
        self,
        state: MapState,
        layer: Layer,
        as_of: int,
        *,
        area: Area | None = None,
        condition: Condition | None = None,
    ) -> list[Any]:
        """All features of a layer, page by page."""
        found: list[Any] = []
        first_id: str | None = None
        while True:
            areas = () if area is None else (area,)
            query = FeatureQuery(
                layer=layer, limit=PAGE_MOST, as_of=as_of, areas=areas, condition=condition, first_id=first_id
            )
            page = await self._source.page(query, state)
            found += json.loads(b"[" + page.features + b"]")
            if page.next_id is None:
                return found
            first_id = page.next_id


def known_landmark(feature: Properties) -> KnownLandmark:
    """A landmark of a page."""
    told = feature["properties"]
    covariance_m2 = told["covariance_m2"]
    lon_deg, lat_deg = feature["geometry"]["coordinates"]
    return KnownLandmark(
        landmark=told["landmark"],
        kind=told["kind"],
        signature=told["signature"],
        grid_m=(told["easting_m"], told["northing_m"]),
        lon_lat_deg=(lon_deg, lat_deg),
        variance_m2=max(covariance_m2[0][0], covariance_m2[1][1]),
        sigma_major_m=told["sigma_major_m"],
    )


def _known_anchor(told: Properties) -> KnownAnchor:
    return KnownAnchor(
        anchor=told["anchor"],
        image=told["image"],
        grid_m=(told["easting_m"], told["northing_m"]),
        sigma_m=told["sigma_m"] or 0.0,
        landmark=told["landmark"],
        reason=told["reason"],
    )


def _known_image(told: Properties) -> KnownImage:
    covariance_m2 = told["covariance_m2"]
    return KnownImage(
        offset_m=(told["offset_x_m"], told["offset_y_m"]), variance_m2=max(covariance_m2[0][0], covariance_m2[1][1])
    )


def _rule_of(settings_json: str) -> AnchoringRule | None:
    """How a version of these settings ties labels, None where they do not say."""
    try:
        settings = json.loads(settings_json)
        anchors = settings["anchors"]
        return AnchoringRule(
            is_anchored=settings["method"] == "anchored",
            image_offsets=bool(settings["image_offsets"]),
            limits=AssociationLimits(
                gate_sigmas=float(anchors["gate_sigmas"]), second_ratio=float(anchors["second_ratio"])
            ),
            min_votes=int(anchors["min_votes"]),
            neighbourhood_m=float(anchors["neighbourhood_m"]),
        )
    except (KeyError, TypeError, ValueError):
        return None
