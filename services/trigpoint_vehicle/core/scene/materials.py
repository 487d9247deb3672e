"""What the world is made of, and how much of a laser's light it sends back."""

from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


class Material(IntEnum):
    """A surface's material."""

    NOTHING = 0
    ASPHALT = 1
    PAINT = 2
    KERB = 3
    GRASS = 4
    WALL = 5
    POLE = 6
    SIGN = 7
    BARK = 8
    LEAF = 9
    CAR = 10
    PERSON = 11


# Diffuse reflectivity near 905 nm, 1 for a white Lambertian surface; a sign is retro-reflective.
REFLECTIVITY: dict[Material, float] = {
    Material.NOTHING: 0.0,
    Material.ASPHALT: 0.15,
    Material.PAINT: 0.75,
    Material.KERB: 0.50,
    Material.GRASS: 0.40,
    Material.WALL: 0.55,
    Material.POLE: 0.45,
    Material.SIGN: 20.0,
    Material.BARK: 0.30,
    Material.LEAF: 0.45,
    Material.CAR: 0.35,
    Material.PERSON: 0.35,
}
DIFFUSE_INTENSITY = (
    100.0  # of reflectivity 1, in the sensor's unit of 0 to 255 (VLP-16 manual, calibrated reflectivity)
)
RETRO_INTENSITY = 200.0


def reflectivities() -> Floats:
    """Reflectivity (m,) by material number."""
    return np.array([REFLECTIVITY[material] for material in Material])


def intensities() -> Floats:
    """The intensity (m,) the sensor reports by material number, before its scatter."""
    diffuse = DIFFUSE_INTENSITY * reflectivities()
    return np.where(diffuse > DIFFUSE_INTENSITY, RETRO_INTENSITY, diffuse)
