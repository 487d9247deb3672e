"""Where one more anchor would help most: landmarks in order of what a label of each would tell of the whole map."""

import json
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trigpoint.anchoring.gain import variance_reductions_m2
from trigpoint.landmarks.model import LabelGain

Floats = NDArray[np.float64]
ImagesAt = Callable[[str], Sequence[str]]

NO_IMAGE = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class LabelSigmas:
    """1-sigma per axis of a label in its image, and of a new image's own place."""

    sigma_m: float
    image_sigma_m: float

    def in_none(self) -> float:
        """Of a label in an image whose offset the map does not know yet."""
        return float(np.hypot(self.sigma_m, self.image_sigma_m))


@dataclass(frozen=True, slots=True, kw_only=True)
class ImageTerms:
    """What labels in one image would tell: the row (l,) of each landmark, and the terms (l, 3) of `gain`."""

    row: Mapping[str, int]
    expected_m2: Floats
    shared_m4: Floats

    def reductions_m2(self, sigma_m: float) -> Floats:
        """By how much a label of each landmark (l,) lowers the summed variance of all."""
        return variance_reductions_m2(self.expected_m2, self.shared_m4, sigma_m=sigma_m)


@dataclass(frozen=True, slots=True, kw_only=True)
class Suggestion:
    """A landmark to label, in which image ("": in none the map knows the offset of), and what that would tell."""

    landmark: str
    image: str
    variance_reduction_m2: float


class MapGains:
    """What one more label would tell of the map, by image; nothing where the map's solve did not say."""

    def __init__(self, gains: Sequence[LabelGain]) -> None:
        self.map_version = gains[0].map_version if gains else None
        self.images = {gain.image: _terms(gain) for gain in gains}

    @property
    def summed_variance_m2(self) -> float | None:
        """The variances of all landmarks, both axes, together."""
        terms = self.images.get(NO_IMAGE)
        return None if terms is None else float(terms.expected_m2[:, [0, 2]].sum())

    def reduction_m2(self, landmark: str, image: str, sigmas: LabelSigmas) -> float | None:
        """What a label of a landmark in an image would tell, None where that is not known."""
        known = image if image in self.images else NO_IMAGE
        row = self._rows(known).get(landmark)
        if row is None:
            return None
        return float(self.images[known].reductions_m2(self._sigma_m(known, sigmas))[row])

    def best(self, limit: int, sigmas: LabelSigmas, *, images_at: ImagesAt, out: Collection[str]) -> list[Suggestion]:
        """The landmarks whose label would tell most, each by itself, best first; `out`: those not to be labelled.

        `images_at` says in which known images a landmark lies; in none of them it would be labelled in a new one.
        """
        terms = self.images.get(NO_IMAGE)
        if terms is None:
            return []
        told = {image: self.images[image].reductions_m2(self._sigma_m(image, sigmas)) for image in self.images}
        found = [self._of(name, images_at(name), told) for name in terms.row if name not in out]
        return sorted(found, key=lambda one: (-one.variance_reduction_m2, one.landmark))[:limit]

    def _of(self, landmark: str, images: Sequence[str], told: Mapping[str, Floats]) -> Suggestion:
        choices = [image for image in images if landmark in self._rows(image)] or [NO_IMAGE]
        reduced = {image: float(told[image][self.images[image].row[landmark]]) for image in choices}
        image = max(choices, key=lambda one: reduced[one])
        return Suggestion(landmark=landmark, image=image, variance_reduction_m2=reduced[image])

    def _rows(self, image: str) -> Mapping[str, int]:
        return self.images[image].row if image in self.images else {}

    @staticmethod
    def _sigma_m(image: str, sigmas: LabelSigmas) -> float:
        return sigmas.sigma_m if image else sigmas.in_none()


def _terms(gain: LabelGain) -> ImageTerms:
    terms = np.array(json.loads(gain.terms_json), dtype=np.float64).reshape(-1, 6)
    names: list[str] = json.loads(gain.landmarks_json)
    rows = {name: row for row, name in enumerate(names)}
    return ImageTerms(row=rows, expected_m2=terms[:, :3], shared_m4=terms[:, 3:])
