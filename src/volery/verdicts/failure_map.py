"""Draws where a flight failed."""

from __future__ import annotations

import io
import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from volery.scenario.expectations import ArrivalExpectation, Expectation
from volery.verdicts.verdict import Verdict

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from volery.core.arrays import Array
    from volery.results import FlightResult

_RADIUS_M = 15.0
"""Min half width of the part of the map that is drawn."""
_BEYOND_GOAL = 1.25
"""Half width relative to the distance of a goal."""
_INCHES, _DPI = 6.4, 110
_RED, _GREEN = "#d1242f", "#1a7f37"


def failure_png(
    flight: FlightResult, verdicts: Sequence[Verdict], expectations: Sequence[Expectation] = ()
) -> bytes:
    """Returns a map of the paths around the first moment at which an expectation failed, as PNG.

    It shows the position and velocity of the UAV, the starts of all UAVs, and where they are
    expected to arrive; the whole flight without such a moment, or without a UAV that failed.
    """
    from matplotlib.figure import Figure
    from matplotlib.patches import Circle

    figure = Figure(figsize=(_INCHES, _INCHES), layout="constrained")
    axes = figure.add_subplot()
    flight.plot(axes)
    axes.set_axis_on()
    axes.set_xlabel("x, m")
    axes.set_ylabel("y, m")
    _draw_starts(axes, flight)
    style: dict[str, Any] = {"fill": False, "edgecolor": _GREEN, "linewidth": 2, "zorder": 19}
    for target, expectation in _goals(expectations):
        axes.add_patch(Circle(target, expectation.within_m, label="expected arrival", **style))
    worst = min(
        (v for v in verdicts if not v.is_passed and v.uav and math.isfinite(v.time_s)),
        key=lambda verdict: verdict.time_s,
        default=None,
    )
    if worst is not None:
        _draw_moment(axes, flight, worst, _goal_of(worst, verdicts, expectations))
    axes.legend(loc="lower right", fontsize=8)
    file = io.BytesIO()
    figure.savefig(file, format="png", dpi=_DPI)
    return file.getvalue()


def _draw_starts(axes: Axes, flight: FlightResult) -> None:
    existing = (p[np.isfinite(p).all(axis=1)] for p in flight.position_map)
    starts = np.array([position[0, :2] for position in existing if len(position)])
    if len(starts):
        style: dict[str, Any] = {"color": "white", "markeredgecolor": "#222222", "zorder": 18}
        axes.plot(starts[:, 0], starts[:, 1], "o", label="start", **style)


def _draw_moment(
    axes: Axes, flight: FlightResult, worst: Verdict, goal: tuple[float, float] | None
) -> None:
    """Draws the position and velocity of a UAV at a moment, and limits the view to them."""
    found = _state(flight, worst.uav, worst.time_s)
    if found is None:
        return
    (x, y), (vx, vy) = found
    label = f"{worst.uav} at {worst.time_s:.2f} s"
    axes.plot([x], [y], "x", color=_RED, markersize=13, markeredgewidth=3, zorder=20, label=label)
    speed = math.hypot(vx, vy)
    if speed > 0.0:
        arrow: dict[str, Any] = {
            "color": _RED,
            "angles": "xy",
            "scale_units": "xy",
            "scale": 1.0,
            "zorder": 20,
        }
        label = f"its horizontal velocity ({speed:.1f} m/s): 1 s ahead"
        axes.quiver([x], [y], [vx], [vy], width=0.006, label=label, **arrow)
    radius = _RADIUS_M
    if goal is not None:
        radius = max(radius, _BEYOND_GOAL * math.hypot(goal[0] - x, goal[1] - y))
    axes.set_xlim(x - radius, x + radius)
    axes.set_ylim(y - radius, y + radius)
    axes.set_title(worst.describe(), fontsize=9, wrap=True)


def _goals(
    expectations: Sequence[Expectation],
) -> Iterator[tuple[tuple[float, float], ArrivalExpectation]]:
    """Yields the positions x, y at which UAVs are expected, map, m."""
    for expectation in expectations:
        if isinstance(expectation, ArrivalExpectation):
            yield (expectation.position_m[0], expectation.position_m[1]), expectation


def _goal_of(
    worst: Verdict, verdicts: Sequence[Verdict], expectations: Sequence[Expectation]
) -> tuple[float, float] | None:
    """Returns the position at which a UAV was expected that did not arrive; None: no such one."""
    failed = [e for v, e in zip(verdicts, expectations, strict=False) if v is worst]
    return next((target for target, _ in _goals(failed)), None)


def _state(flight: FlightResult, uav: str, time_s: float) -> tuple[Array, Array] | None:
    """Returns position and velocity x, y at the sample next to a time; None if there is none."""
    if uav not in flight.uavs:
        return None
    sample = int(np.argmin(np.abs(flight.times_s - time_s)))
    position: Array = flight[uav].position_map[sample, :2]
    velocity: Array = flight[uav].velocity_map[sample, :2]
    return (position, velocity) if np.isfinite(position).all() else None
