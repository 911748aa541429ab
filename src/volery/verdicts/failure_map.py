"""Draws where a flight failed."""

from __future__ import annotations

import io
import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from volery.verdicts.verdict import Verdict

if TYPE_CHECKING:
    from volery.core.arrays import Array
    from volery.results import FlightResult

_RADIUS_M = 15.0
"""Half the width of the part of the map that is drawn."""
_INCHES, _DPI = 6.0, 110


def failure_png(flight: FlightResult, verdicts: Sequence[Verdict]) -> bytes:
    """Returns a map of the paths around the first moment at which an expectation failed, as PNG.

    The map of the whole flight without such a moment, or without a UAV that failed.
    """
    from matplotlib.figure import Figure

    worst = min(
        (v for v in verdicts if not v.is_passed and v.uav and math.isfinite(v.time_s)),
        key=lambda verdict: verdict.time_s,
        default=None,
    )
    position = None if worst is None else _position(flight, worst.uav, worst.time_s)
    if worst is None or position is None:
        return flight._repr_png_()
    figure = Figure(figsize=(_INCHES, _INCHES), layout="constrained")
    axes = figure.add_subplot()
    flight.plot(axes)
    x, y = float(position[0]), float(position[1])
    axes.set_xlim(x - _RADIUS_M, x + _RADIUS_M)
    axes.set_ylim(y - _RADIUS_M, y + _RADIUS_M)
    axes.plot([x], [y], "x", color="#d1242f", markersize=13, markeredgewidth=3, zorder=20)
    axes.set_title(f"{worst.uav} at {worst.time_s:.2f} s: {worst.name}", fontsize=9, wrap=True)
    file = io.BytesIO()
    figure.savefig(file, format="png", dpi=_DPI)
    return file.getvalue()


def _position(flight: FlightResult, uav: str, time_s: float) -> Array | None:
    """Returns the position of a UAV at the sample next to a time; None if there is none."""
    if uav not in flight.uavs:
        return None
    sample = int(np.argmin(np.abs(flight.times_s - time_s)))
    position: Array = flight[uav].position_map[sample]
    return position if np.isfinite(position).all() else None
