"""Light and surfaces for cameras: sun, sky, haze, and the colours of materials.

Colours are linear (r, g, b) with 1 for a white surface in full sun; images are coded by sRGB. All
numbers here are modelling choices for a clear day unless a source is named.
"""

from __future__ import annotations

import math
from itertools import chain
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.world.materials import PROPERTIES, Material

CODES = 4096
"""Entries of the table from linear light to a byte."""
CLEAR = 8192
LAST_DEPTH = 8.0
"""Optical depth at which only haze is visible: exp(-8) is a tenth of a byte's step."""
GRAIN = 64
"""Side of the table of random greys."""


class Light(NamedTuple):
    """Light and materials for shading kernels; see `make_light`."""

    sun: NDArray[np.float32]
    """(3,) unit vector towards the sun, map frame."""
    sun_colour: NDArray[np.float32]
    """(3,) colour of a white surface that faces the sun."""
    zenith: NDArray[np.float32]
    """(3,) colour of the sky overhead."""
    horizon: NDArray[np.float32]
    """(3,) colour of the sky at the horizon, and of haze."""
    bounce: NDArray[np.float32]
    """(3,) light that the ground reflects upward."""
    overhead: NDArray[np.float32]
    """(3,) light of the sky on a horizontal surface."""
    clear: NDArray[np.float32]
    """(CLEAR,) fraction of contrast left at a distance: exp(-extinction d)."""
    clear_per_m: float
    """Entries of `clear` per metre; the last one holds for all greater distances."""
    surface: NDArray[np.float32]
    """(materials, 8): colour, second colour, size of the grain 1/m, fraction of light let through.
    """
    grain: NDArray[np.float32]
    """(GRAIN, GRAIN) random greys from 0 to 1, periodic at the edges."""
    code: NDArray[np.uint8]
    """(CODES,) bytes of linear light from 0 to 1."""


def make_light(
    sun_elevation_deg: float = 50.0, sun_azimuth_deg: float = 135.0, visibility_m: float = 20_000.0
) -> Light:
    """Returns the light of a clear day; azimuth clockwise from north.

    visibility_m: distance at which a contrast of 1 has faded to .05, so that extinction is 3 /
    visibility (the meteorological optical range of the WMO, Guide to Instruments WMO-No. 8, ch. 9).
    """
    elevation, azimuth = math.radians(sun_elevation_deg), math.radians(sun_azimuth_deg)
    level = math.cos(elevation)
    sun = (level * math.sin(azimuth), level * math.cos(azimuth), math.sin(elevation))
    height = max(math.sin(elevation), 0.0)
    strength = min(1.0, 3.0 * height) * 0.9
    day = min(1.0, 0.05 + 2.0 * max(math.sin(elevation) + 0.1, 0.0))
    warm = np.array([1.0, 0.75 + 0.25 * min(1.0, 3.0 * height), 0.5 + 0.5 * min(1.0, 2.0 * height)])
    return Light(
        sun=_row(sun),
        sun_colour=_row(1.6 * strength * warm),
        zenith=_row(day * np.array([0.13, 0.26, 0.60])),
        horizon=_row(day * np.array([0.55, 0.66, 0.80])),
        bounce=_row(day * np.array([0.14, 0.14, 0.10])),
        overhead=_row(day * np.array([0.52, 0.79, 1.41])),
        clear=_row(np.exp(-LAST_DEPTH * (np.arange(CLEAR) + 0.5) / CLEAR)),
        clear_per_m=CLEAR * 3.0 / (LAST_DEPTH * visibility_m),
        surface=_surface_table(),
        grain=_grain(),
        code=_codes(),
    )


def base_colours() -> dict[Material, tuple[float, float, float]]:
    """Returns the linear (r, g, b) of each material, averaged over its texture."""
    rows = _surface_table()
    return {
        material: (float(r), float(g), float(b))
        for material, (r, g, b) in zip(Material, 0.5 * (rows[:, :3] + rows[:, 3:6]), strict=True)
    }


def _surface_table() -> NDArray[np.float32]:
    rows = [
        [*chain(*surface["colours"]), surface["grain_1_m"], surface["transmission"]]
        for surface in PROPERTIES.values()
    ]
    return np.array(rows, dtype=np.float32)


def _grain() -> NDArray[np.float32]:
    """Returns evenly distributed greys (GRAIN, GRAIN) with a slight correlation of neighbours."""
    greys = np.random.default_rng(20_251_121).random((GRAIN, GRAIN))
    for axis in (0, 1):
        greys = 0.5 * greys + 0.25 * (np.roll(greys, 1, axis) + np.roll(greys, -1, axis))
    ranks = np.argsort(np.argsort(greys.ravel(), kind="stable"), kind="stable")
    return np.asarray((ranks / (ranks.size - 1)).reshape(greys.shape), dtype=np.float32)


def _codes() -> NDArray[np.uint8]:
    """Returns (CODES,) bytes by IEC 61966-2-1 (sRGB)."""
    linear = np.linspace(0.0, 1.0, CODES)
    coded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    return np.asarray(np.round(255.0 * coded), dtype=np.uint8)


def _row(values: object) -> NDArray[np.float32]:
    return np.array(values, dtype=np.float32)
