"""The report of a log: true and estimated trajectories, optionally with a real flight."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import NamedTuple

import numpy as np

from volery.core.arrays import Array
from volery.core.errors import VoleryError
from volery.core.plurals import counted
from volery.report.logged_flights import LoggedFlight, LoggedUav, read_flight, read_trajectory
from volery.report.page import ReportError, chart_figure, check_target, html_page, write_page
from volery.report.team_section import team_section
from volery.report.trajectories import RecordedTrajectory
from volery.report.trajectory_charts import (
    ChartLine,
    date_text,
    is_date,
    over_time,
    trajectories_from_above,
)
from volery.report.true_trunks import TrueTrunks, true_trunks
from volery.results.alignment import (
    TimeShift,
    at_times,
    ate_rmse_m,
    common_times,
    time_shift,
    umeyama,
)

_MIN_POSES = 10
"""Min number of common poses for an error."""
_APART = ".chart + .pair { margin-top: 1.2rem; }\n"
"""Space between the map and the charts below it, as between these."""
_ALIKE, _MAX_LEFT_FRACTION = 0.95, 0.1
"""Thresholds of the correlation of speeds, and of the distance relative to the spread, beyond which
the flights may differ. Between two UAVs of one forest search, whose missions begin alike, 0.85 to
0.91 and 0.12 to 0.15 were measured; between ground truth and estimate of one flight 1.00 and less
than 0.01.
"""
_TRUE_M = 0.5
"""Max distance between a mapped trunk and its tree."""
_LONG_SHIFT_S = 86_400.0
_MIN_S, _MAX_S = 3.0, 86_400.0
"""Min duration for a time alignment, and max duration searched, s."""


class LogReport(NamedTuple):
    """Result of writing a report."""

    path: Path
    warnings: list[str]
    """Warnings for the reader."""
    fit: str = ""
    """Fit of a real flight to the simulated one, if compared."""


def write_log_report(
    log: Path,
    folder: Path,
    *,
    compare: Path | None = None,
    compare_topic: str | None = None,
    uav: str | None = None,
    overwrite: bool = False,
) -> LogReport:
    """Writes `index.html` into `folder`; replaces an existing one only with `overwrite`.

    compare: log of a real flight, drawn over that of `uav` (None: the first) in `log`, aligned in
    time by their speeds and in space by rotation and translation. compare_topic: its poses; None:
    the only ones. Without compare, `uav` alone is drawn, None: all, and their team. Raises
    VoleryError for logs without the requested data.
    """
    warnings, fit = list[str](), ""
    if compare is None and compare_topic is not None:
        raise ReportError(f"--compare-topic {compare_topic}: name its log by --compare")
    check_target(folder, overwrite=overwrite)
    flight = read_flight(log)
    chosen = _chosen(flight.uavs, uav, log)
    drawn = flight.uavs if uav is None or compare is not None else [chosen]
    trunks = true_trunks(flight.origin, log.parent)
    parts = _problem_notes(log, flight.problem, warnings)
    parts += team_section(flight) if uav is None else []
    parts += [section for each in drawn for section in _estimate_section(each, trunks)]
    if compare is not None:
        real = read_trajectory(compare, compare_topic)
        parts += _problem_notes(compare, real.problem, warnings)
        laid = _laid_over(chosen, real.trajectory, compare)
        parts += _comparison_section(chosen, laid, compare, trunks)
        warnings += laid.mismatches(compare)
        fit = laid.fit
    path = write_page(_page(log.name, _lead(flight), parts), folder, overwrite=overwrite)
    return LogReport(path, warnings, fit)


def _problem_notes(log: Path, problem: str, warnings: list[str]) -> list[str]:
    """Returns a note for the page about a problem of a log's file, and adds a warning."""
    if not problem:
        return []
    warnings.append(f"{log}: {problem}; the report shows what can be read")
    return [f'<p class="note">{escape(log.name)}: {escape(problem)}.</p>']


def _chosen(uavs: Sequence[LoggedUav], name: str | None, log: Path) -> LoggedUav:
    for each in uavs:
        if name in (None, each.name):
            return each
    known = ", ".join(each.name for each in uavs)
    raise VoleryError(f"{log}: no UAV {name}; known: {known}")


def _estimate_section(uav: LoggedUav, trunks: TrueTrunks) -> list[str]:
    """Draws simulated against estimated: from above with the trunks, x and y over time."""
    lines = []
    if uav.truth is not None:
        lines.append(ChartLine("simulated", uav.truth.time_s, uav.truth.position))
    if uav.estimate is not None:
        lines.append(ChartLine("estimated", uav.estimate.time_s, uav.estimate.position))
    caption = "Trajectory and trunk map."
    if len(uav.trunks):
        caption = (
            f"Trajectory and {counted(len(uav.trunks), 'trunk')} detected by the level LIDAR three "
            "times or more, where the estimate puts them."
        )
        if not uav.is_founded:
            caption += (
                " Without a nodding LIDAR shapes alone count: crowns and rises of the "
                "ground may be among them."
            )
    near = trunks.near(np.concatenate([line.position for line in lines]))
    caption += _trunks_text(uav.trunks, near)
    if uav.truth is not None and uav.estimate is not None:
        caption += _error_text(uav.estimate, uav.truth)
    return [f"<h2>{escape(uav.name)}</h2>", *_figures(lines, uav.trunks, near, caption)]


def _trunks_text(found: Array, near: TrueTrunks) -> str:
    """Explains the rings, and how well mapped trunks fit them."""
    if near.why_none:
        return f" {escape(near.why_none)}"
    if not len(near.positions):
        return " No tree of the scenario is within 15 m of the trajectory."
    caption = (
        f" Rings: {counted(len(near.positions), 'tree')} of the scenario within 15 m of it, by "
        "the width of trunks (thin ones enlarged)."
    )
    away = near.distances_m(found)
    if len(away):
        caption += (
            f" {(away <= _TRUE_M).mean():.0%} of the mapped trunks are within {_TRUE_M} m of "
            "one, by the estimated poses."
        )
    return caption


def _error_text(estimate: RecordedTrajectory, truth: RecordedTrajectory) -> str:
    known = common_times(estimate.time_s, truth.time_s)
    if known.sum() < _MIN_POSES:
        return ""
    own = estimate.position[known]
    true = at_times(truth.time_s, truth.position, estimate.time_s[known])
    raw = _rms(own - true)
    return (
        f" Root mean square error {raw:.2f} m without, {ate_rmse_m(own, true):.2f} m after "
        "rigid alignment (Umeyama), over "
        f"{float(np.linalg.norm(np.diff(true, axis=0), axis=1).sum()):.0f} m."
    )


class _Laid(NamedTuple):
    """A real trajectory aligned with a simulated one."""

    lines: list[ChartLine]
    shift: TimeShift
    left_m: float
    """Root mean square distance, m."""
    size_m: float
    """Root mean square distance of the simulated trajectory from its centroid, m."""
    fraction: float
    """Fraction of the real trajectory's poses within common times."""

    @property
    def fit(self) -> str:
        """Fit of the two trajectories, as text."""
        return (
            f"correlation of speeds {self.shift.alike:.2f}, {self.left_m:.2f} m apart (root mean "
            f"square) over {self.fraction:.0%} of it"
        )

    def mismatches(self, log: Path) -> list[str]:
        """Returns the reasons why the two may be different flights."""
        found = []
        if self.shift.alike < _ALIKE:
            found.append(
                f"the speeds differ (correlation {self.shift.alike:.2f}: 1 is the same flight, and "
                "two UAVs on missions that begin alike reach 0.9), so the shift in time may be "
                "wrong"
            )
        if self.left_m > _MAX_LEFT_FRACTION * self.size_m:
            found.append(
                f"the trajectories are {self.left_m:.2f} m apart (root mean square), the simulated "
                f"one spreads by {self.size_m:.1f} m"
            )
        return [f"{log}: it may be another flight: {mismatch}" for mismatch in found]


def _laid_over(uav: LoggedUav, real: RecordedTrajectory, log: Path) -> _Laid:
    simulated = uav.truth or uav.estimate
    if simulated is None or min(real.lasts_s, simulated.lasts_s) < _MIN_S:
        raise VoleryError(f"{log}: too few poses for a comparison with {uav.name}")
    if real.lasts_s > _MAX_S:
        raise VoleryError(
            f"{log}: its poses span {real.lasts_s / 3600.0:.0f} hours; was its clock set in flight?"
        )
    shift = time_shift(simulated.time_s, simulated.position, real.time_s, real.position)
    times = real.time_s + shift.seconds
    known = common_times(times, simulated.time_s)
    if known.sum() < _MIN_POSES:
        raise VoleryError(f"{log}: no time in common with {uav.name}")
    there = at_times(simulated.time_s, simulated.position, times[known])
    aligned = umeyama(real.position[known], there).apply(real.position)
    lines = [
        ChartLine(f"simulated {uav.name}", simulated.time_s, simulated.position),
        ChartLine("real", times, aligned),
    ]
    left, size = (
        _rms(difference) for difference in (aligned[known] - there, there - there.mean(axis=0))
    )
    return _Laid(lines, shift, left, size, float(known.mean()))


def _rms(offsets: Array) -> float:
    return float(np.sqrt((offsets**2).sum(axis=1).mean()))


def _shift_text(laid: _Laid) -> str:
    """Describes the shift of the real flight's clock; large shifts by the dates."""
    shift_s, begins_s = laid.shift.seconds, float(laid.lines[1].time_s[0])
    real_s = begins_s - shift_s
    if abs(shift_s) > _LONG_SHIFT_S and is_date(real_s):
        at = date_text(begins_s) if is_date(begins_s) else f"{begins_s:.2f} s"
        return f"its clock moved so that {date_text(real_s)}, its beginning, is {at}"
    moved = round(shift_s, 2) + 0.0  # without -0.0
    return f"its clock moved by {moved:,.2f} s"


def _comparison_section(uav: LoggedUav, laid: _Laid, log: Path, trunks: TrueTrunks) -> list[str]:
    """Draws a real flight over the simulated one."""
    caption = (
        f"The flight of {escape(log.name)} over that of {escape(uav.name)}: {_shift_text(laid)} "
        f"(where their speeds are most alike, with a correlation of "
        f"{laid.shift.alike:.2f}), turned and moved onto it. Root mean square distance "
        f"{laid.left_m:.2f} m over {laid.fraction:.0%} of it."
    )
    notes = [
        f'<p class="note">{escape(mismatch)}.</p>' for mismatch in laid.mismatches(Path(log.name))
    ]
    near = trunks.near(laid.lines[0].position)
    figures = _figures(laid.lines, uav.trunks, near, caption)
    return ["<h2>Real against simulated</h2>", *notes, *figures]


def _lead(flight: LoggedFlight) -> list[str]:
    """Returns the summary of the whole flight."""
    count = len(flight.uavs)
    fleet = counted(count, "UAV")
    scenario = f"Scenario {flight.scenario}, " if flight.scenario else ""
    texts = [flight.description, f"{scenario}{flight.lasts_s:.1f} s with {fleet}."]
    return [f'<p class="lead">{escape(text)}</p>' for text in texts if text]


def _figures(
    lines: Sequence[ChartLine], trunks: Array, true: TrueTrunks, caption: str
) -> list[str]:
    def figure(svg: str, text: str) -> str:
        return chart_figure(svg, f"<figcaption>{text}</figcaption>")

    return [
        figure(trajectories_from_above(lines, trunks, true), caption),
        '<div class="pair">',
        figure(over_time(lines, 0), "x over time."),
        figure(over_time(lines, 1), "y over time."),
        "</div>",
    ]


def _page(title: str, lead: Sequence[str], parts: Sequence[str]) -> str:
    header = f'<header><p class="kicker">Volery flight report</p><h1>{escape(title)}</h1>'
    return html_page(title, [header, *lead, "</header>", *parts], _APART)
