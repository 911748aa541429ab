"""Loss of a radio signal between two positions, dB: distance, foliage, trunks, walls, ground.

| part | formula | source |
|---|---|---|
| distance | 20 lg(4 pi f / c) + 10 n lg(d), d from 1 m on | log-distance law; n = 2 is H. T. Friis, A note on a simple transmission formula, 1946 |
| foliage `p833` | A (1 - exp(-d gamma / A)) | Recommendation ITU-R P.833-9, 2.1, a terminal in woodland |
| foliage `weissberger` | .45 f^.284 d up to 14 m, then 1.33 f^.284 d^.588 up to 400 m, f in GHz | M. A. Weissberger, ESD-TR-81-101, 1982 |
| trunks, walls, ground | a constant each | modelling choice |
"""  # noqa: E501

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from volery.core.arrays import Array
from volery.scenario.radio import Radio

_LIGHT_M_S = 299_792_458.0
_REFERENCE_M = 1.0
_WEISSBERGER_KNEE_M, _WEISSBERGER_END_M = 14.0, 400.0

# Recommendation ITU-R P.833-9, table of specific attenuation (dB/m) and of the maximum that
# woodland takes (dB), by frequency in MHz: mixed forest near St. Petersburg.
_P833_MHZ = np.array([105.9, 466.475, 949.0, 1852.2, 2117.5])
_P833_DB_M = np.array([0.04, 0.12, 0.17, 0.30, 0.34])
_P833_MAX_DB = np.array([9.4, 18.0, 26.5, 29.0, 34.1])


class Paths(NamedTuple):
    """Obstacles along P lines of sight."""

    foliage_m: Array
    """(P,) length inside foliage."""
    trunks: NDArray[np.int64]
    """(P,) trunks and branches crossed."""
    walls: NDArray[np.int64]
    """(P,) surfaces of solids crossed."""
    ground: NDArray[np.bool_]
    """(P,) whether the ground blocks the line of sight."""

    @classmethod
    def clear(cls, count: int) -> Paths:
        """Returns unobstructed paths."""
        none = np.zeros(count, np.int64)
        return cls(np.zeros(count), none, none.copy(), np.zeros(count, np.bool_))


def loss_db(radio: Radio, distance_m: Array, paths: Paths) -> Array:
    """Returns the losses (P,) dB over distances (P,) m with `paths`, without antennas."""
    lost: Array = (
        distance_loss_db(radio, distance_m)
        + foliage_loss_db(radio, paths.foliage_m)
        + radio.trunk_loss_db * paths.trunks
        + radio.wall_loss_db * paths.walls
        + radio.ground_loss_db * paths.ground
    )
    return lost


def distance_loss_db(radio: Radio, distance_m: Array) -> Array:
    """Returns the losses (P,) dB over distances (P,) m; below 1 m as at 1 m."""
    first = 20.0 * math.log10(4.0 * math.pi * radio.frequency_mhz * 1e6 / _LIGHT_M_S)
    lost: Array = first + 10.0 * radio.exponent * np.log10(np.maximum(distance_m, _REFERENCE_M))
    return lost


def foliage_loss_db(radio: Radio, depth_m: Array) -> Array:
    """Returns the losses (P,) dB in foliage of depths (P,) m."""
    if radio.vegetation == "none":
        return np.zeros_like(depth_m)
    if radio.vegetation == "weissberger":
        return _weissberger_db(radio.frequency_mhz * 1e-3, depth_m)
    per_m, max_db = woodland(radio.frequency_mhz)
    loss: Array = max_db * -np.expm1(-depth_m * per_m / max_db)
    return loss


def woodland(frequency_mhz: float) -> tuple[float, float]:
    """Returns the specific attenuation, dB/m, and the max loss, dB, of woodland by ITU-R P.833.

    It interpolates its table linearly in the logarithms, and extrapolates by the power law through
    both ends.
    """
    return _in_table(frequency_mhz, _P833_DB_M), _in_table(frequency_mhz, _P833_MAX_DB)


def _in_table(frequency_mhz: float, values: Array) -> float:
    x, xs, ys = np.log(frequency_mhz), np.log(_P833_MHZ), np.log(values)
    slope = (ys[-1] - ys[0]) / (xs[-1] - xs[0])
    inside = np.interp(x, xs, ys)
    beyond = x - np.clip(x, xs[0], xs[-1])
    return float(np.exp(inside + slope * beyond))


def _weissberger_db(frequency_ghz: float, depth_m: Array) -> Array:
    scale = frequency_ghz**0.284
    far = 1.33 * scale * np.minimum(depth_m, _WEISSBERGER_END_M) ** 0.588
    loss: Array = np.where(depth_m <= _WEISSBERGER_KNEE_M, 0.45 * scale * depth_m, far)
    return loss
