"""The report of a log: where each UAV was, where it thought it was, and a real flight beside it."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from volery.core.errors import VoleryError
from volery.report.alignment import (
    at_times,
    ate_rmse_m,
    common_times,
    time_shift_s,
    umeyama,
)
from volery.report.logged_flights import LoggedUav, read_flight, read_way
from volery.report.page import STYLE, ReportError
from volery.report.way_charts import Line, over_time, ways_from_above
from volery.report.ways import Way

Array = NDArray[np.float64]

_LEAST = 10
"""Poses in common that an error can be told from."""
_LEAST_S, _MOST_S = 3.0, 86_400.0
"""Seconds that a common time can be found from, and is looked for in."""


def write_log_report(
    log: Path,
    folder: Path,
    *,
    compare: Path | None = None,
    compare_topic: str | None = None,
    uav: str | None = None,
) -> Path:
    """Write `index.html` into `folder` and return its path.

    compare: log of a real flight, laid over that of `uav` (None: the first) in `log`, aligned in
    time by their speeds and in space by rotation and translation. compare_topic: its poses; None:
    the only ones there. `VoleryError` for logs that do not hold what is asked for.
    """
    uavs = read_flight(log).uavs
    parts = [section for each in uavs for section in _estimate_section(each)]
    if compare is not None:
        simulated = _chosen(uavs, uav, log)
        real = read_way(compare, compare_topic)
        parts += _comparison_section(simulated, real, compare)
    path = folder / "index.html"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        path.write_text(_page(log.name, parts), encoding="utf-8")
    except OSError as error:
        raise ReportError(f"{path}: cannot write the report: {error.strerror}") from None
    return path


def _chosen(uavs: Sequence[LoggedUav], name: str | None, log: Path) -> LoggedUav:
    for each in uavs:
        if name in (None, each.name):
            return each
    known = ", ".join(each.name for each in uavs)
    raise VoleryError(f"{log}: there is no {name} in it; known: {known}")


def _estimate_section(uav: LoggedUav) -> list[str]:
    """Simulated against estimated: from above with the trunks, x and y over time."""
    lines = []
    if uav.truth is not None:
        lines.append(Line("simulated", uav.truth.time_s, uav.truth.position))
    if uav.estimate is not None:
        lines.append(Line("estimated", uav.estimate.time_s, uav.estimate.position))
    told = "Trajectory and trunk map."
    if len(uav.trunks):
        told = (
            f"Trajectory, and {len(uav.trunks)} trunks that the level LIDAR saw three times or "
            "more, where the estimate puts them."
        )
        if not uav.is_founded:
            told += (
                " No nodding LIDAR tells what stands on the ground: crowns and rises of the "
                "ground may be among them."
            )
    if uav.truth is not None and uav.estimate is not None:
        told += _error_text(uav.estimate, uav.truth)
    return [f"<h2>{escape(uav.name)}</h2>", *_figures(lines, uav.trunks, told)]


def _error_text(estimate: Way, truth: Way) -> str:
    known = common_times(estimate.time_s, truth.time_s)
    if known.sum() < _LEAST:
        return ""
    own = estimate.position[known]
    true = at_times(truth.time_s, truth.position, estimate.time_s[known])
    raw = float(np.sqrt(((own - true) ** 2).sum(axis=1).mean()))
    return (
        f" Root mean square error {raw:.2f} m as it stands, {ate_rmse_m(own, true):.2f} m after "
        "rigid alignment (Umeyama), over "
        f"{float(np.linalg.norm(np.diff(true, axis=0), axis=1).sum()):.0f} m."
    )


def _comparison_section(uav: LoggedUav, real: Way, log: Path) -> list[str]:
    """A real flight over the simulated one."""
    simulated = uav.truth or uav.estimate
    if simulated is None or min(real.lasts_s, simulated.lasts_s) < _LEAST_S:
        raise VoleryError(f"{log}: too few poses to lay it over {uav.name}")
    if real.lasts_s > _MOST_S:
        raise VoleryError(
            f"{log}: its poses span {real.lasts_s / 3600.0:.0f} hours; was its clock set meanwhile?"
        )
    shift = time_shift_s(simulated.time_s, simulated.position, real.time_s, real.position)
    times = real.time_s + shift
    known = common_times(times, simulated.time_s)
    if known.sum() < _LEAST:
        raise VoleryError(f"{log}: it has no time in common with {uav.name}")
    there = at_times(simulated.time_s, simulated.position, times[known])
    aligned = umeyama(real.position[known], there).apply(real.position)
    left = float(np.sqrt(((aligned[known] - there) ** 2).sum(axis=1).mean()))
    lines = [
        Line(f"simulated {uav.name}", simulated.time_s, simulated.position),
        Line("real", times, aligned),
    ]
    told = (
        f"The flight of {escape(log.name)} over that of {escape(uav.name)}: its clock moved by "
        f"{shift:.2f} s (where their speeds are most alike), turned and moved onto it. Root mean "
        f"square distance {left:.2f} m over {float(known.sum()) / len(known):.0%} of it."
    )
    return ["<h2>Real against simulated</h2>", *_figures(lines, uav.trunks, told)]


def _figures(lines: Sequence[Line], trunks: Array, told: str) -> list[str]:
    def figure(svg: str, text: str) -> str:
        return f'<figure class="chart">{svg}<figcaption>{text}</figcaption></figure>'

    return [
        figure(ways_from_above(lines, trunks), told),
        '<div class="pair">',
        figure(over_time(lines, 0), "x over time."),
        figure(over_time(lines, 1), "y over time."),
        "</div>",
    ]


def _page(title: str, parts: Sequence[str]) -> str:
    name = escape(title)
    head = [
        "<!doctype html>",
        '<html lang="en"><head><meta charset="utf-8">',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        '<meta name="color-scheme" content="light dark">',
        f"<title>{name} · flight report</title>",
        f"<style>{STYLE}</style></head><body><main>",
        f'<header><p class="kicker">Volery flight report</p><h1>{name}</h1></header>',
    ]
    return "\n".join([*head, *parts, "</main></body></html>"]) + "\n"
