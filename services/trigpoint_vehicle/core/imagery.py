"""Aerial images, each a little off, and the poles a person labelled in them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trigpoint.errors import InputError
from trigpoint_vehicle.core.campus_settings import ImagerySettings

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Imagery:
    """Images in rows from south to north: name, offset_m (n, 2) of what is seen in them from where it truly is."""

    image: tuple[str, ...]
    offset_m: Floats


@dataclass(frozen=True, slots=True, kw_only=True)
class Labels:
    """Labelled landmarks (n,): their number, the number of the image, and the position read (n, 2) in grid metres."""

    landmark: Ints
    image: Ints
    position_m: Floats


@dataclass(frozen=True, slots=True, kw_only=True)
class PolesSeen:
    """Poles (n, 2) in grid metres and how often each was detected (n,), on a campus of `extent_m` east and north
    with the quadrangle between two corners."""

    pole_m: Floats
    sightings: Ints
    quadrangle_m: tuple[Floats, Floats]
    extent_m: tuple[float, float]


def taken_imagery(settings: ImagerySettings, rng: np.random.Generator) -> Imagery:
    """The images with their offsets."""
    names = [f"image-{row}-{column}" for row in range(settings.rows) for column in range(settings.columns)]
    return Imagery(image=tuple(names), offset_m=rng.normal(0.0, settings.offset_sigma_m, (len(names), 2)))


def image_numbers(point_m: Floats, extent_m: tuple[float, float], settings: ImagerySettings) -> Ints:
    """The number of the image (n,) that shows each point (n, 2); points outside belong to the nearest image."""
    share = point_m / np.array(extent_m) * (settings.columns, settings.rows)
    column, row = np.clip(np.floor(share), 0, (settings.columns - 1, settings.rows - 1)).astype(np.int64).T
    numbers: Ints = row * settings.columns + column
    return numbers


def _drawn(candidates: Ints, count: int, where: str, rng: np.random.Generator) -> Ints:
    if len(candidates) < count:
        raise InputError(f"{count} labels wanted {where}, only {len(candidates)} poles were seen often enough there")
    return np.sort(rng.choice(candidates, size=count, replace=False))


def _spread(candidates: Ints, image: Ints, count: int, rng: np.random.Generator) -> Ints:
    # one image after the other, so that every image with poles has its share
    shuffled = rng.permutation(candidates)
    turn = np.zeros(len(shuffled), dtype=np.int64)
    for number in np.unique(image[shuffled]):
        mine = image[shuffled] == number
        turn[mine] = np.arange(mine.sum())
    return np.sort(shuffled[np.argsort(turn, kind="stable")][:count])


def _distance_to_box_m(point_m: Floats, box_m: tuple[Floats, Floats]) -> Floats:
    outside = np.maximum(np.maximum(box_m[0] - point_m, point_m - box_m[1]), 0.0)
    return np.hypot(outside[:, 0], outside[:, 1])


def read_labels(seen: PolesSeen, imagery: Imagery, settings: ImagerySettings, rng: np.random.Generator) -> Labels:
    """Labels of poles seen often enough: so many in the quadrangle, beside it, elsewhere.

    Raises InputError if there are too few poles.
    """
    often = seen.sightings >= settings.sightings_min
    image = image_numbers(seen.pole_m, seen.extent_m, settings)
    middle = image_numbers(np.mean(seen.quadrangle_m, axis=0)[None], seen.extent_m, settings)[0]
    away_m = _distance_to_box_m(seen.pole_m, seen.quadrangle_m)
    inside = np.flatnonzero(often & (away_m == 0.0) & (image == middle))
    beside = np.flatnonzero(often & (away_m > 0.0) & (away_m <= settings.beside_distance_m))
    far = np.flatnonzero(often & (away_m > settings.beside_distance_m))
    chosen = np.concatenate(
        [
            _drawn(inside, settings.labels_in_quadrangle, "in the quadrangle", rng),
            _drawn(beside, settings.labels_beside_it, "beside the quadrangle", rng),
            _spread(far, image, settings.labels_elsewhere, rng),
        ]
    )
    error_m = rng.normal(0.0, settings.label_sigma_m, (len(chosen), 2))
    read_m = seen.pole_m[chosen] + imagery.offset_m[image[chosen]] + error_m
    return Labels(landmark=chosen, image=image[chosen], position_m=read_m)
