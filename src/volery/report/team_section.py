"""The section of a log's report on a formation or a flock."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from volery.core.arrays import Array
from volery.core.plurals import counted
from volery.report.logged_flights import LoggedFlight
from volery.report.logged_teams import FORMATION, LoggedTeam
from volery.report.page import chart_figure
from volery.report.team_charts import (
    TeamMoment,
    TimeAxis,
    cost_over_time,
    distance_over_time,
    energy_bars,
    formation_views,
    lines_over_time,
)
from volery.report.trajectories import RecordedTrajectory
from volery.report.trajectory_charts import clock_of

_VIEWS = 6
_STEP_S = 0.1
"""Period at which distances between UAVs are measured, s."""
_MAX_STEPS = 36_000
_SPEED_S = 0.5
"""Time before a moment over which velocities are measured, s."""
_J_PER_WH = 3600.0
_PARTS = {
    "velocity_matching": "velocity matching",
    "clear_view": "clear view",
    "upwash": "upwash",
}
"""Names of the fitness's parts in the chart, by their keys in the status."""


def team_section(flight: LoggedFlight) -> list[str]:
    """Returns the parts of the page on a team; none if the log holds no status of one."""
    team = flight.team
    if team is None:
        return []
    flown = {each.name: each.truth or each.estimate for each in flight.uavs}
    paths = {name: path for name, path in flown.items() if path is not None and len(path.time_s)}
    ends_s = [float(path.time_s[-1]) for path in paths.values()]
    starts_s = [float(path.time_s[0]) for path in paths.values()]
    start_s, label = clock_of(starts_s)
    end_s = max(ends_s, default=0.0) - start_s
    axis = TimeAxis(label, end_s, team.search_times_s - start_s, team.time_to_v_s - start_s)
    charts = [
        *_status_charts(team, start_s, axis),
        *_distance_chart(team, paths, start_s, axis),
        *_energy_chart(flight),
    ]
    views = _views(team, paths, start_s)
    return ["<h2>The team</h2>", *views, '<div class="pair">', *charts, "</div>"]


def _views(team: LoggedTeam, paths: dict[str, RecordedTrajectory], start_s: float) -> list[str]:
    """Draws the formation at some moments."""
    moments = []
    for number in team.moments(_VIEWS):
        time_s, phase = float(team.time_s[number]), team.phases[number]
        positions = {name: _positions(path, time_s) for name, path in paths.items()}
        names = [
            name
            for name, (_before, now) in positions.items()
            if np.isfinite(now).all() and (name in team.members[number] or not phase)
        ]
        if not names:
            continue
        before, now = np.array([positions[name] for name in names]).transpose(1, 0, 2)
        velocity = np.nan_to_num(now - before).mean(axis=0) / _SPEED_S
        title = ", ".join(filter(None, (f"{time_s - start_s:.1f} s", phase)))
        moments.append(TeamMoment(title, names, now - now.mean(axis=0), velocity))
    if not moments:
        return []
    caption = (
        "The team from above, relative to its middle, in equal scale; east is right, north is up. "
        "The arrow is the direction of flight, the foremost UAV orange."
    )
    return [_figure(formation_views(moments), caption)]


def _positions(path: RecordedTrajectory, time_s: float) -> Array:
    """Returns horizontal positions (2, 2) m shortly before a time and at it."""
    return path.positions_at(np.array([time_s - _SPEED_S, time_s]))[:, :2]


def _status_charts(team: LoggedTeam, start_s: float, axis: TimeAxis) -> list[str]:
    """Draws what the node publishes about the formation."""
    time_s, numbers = team.time_s - start_s, team.numbers
    if team.topic != FORMATION:
        lines = {
            "order": numbers["order"],
            "arrived": numbers["arrived"] / np.maximum(numbers["members"], 1.0),
        }
        svg = lines_over_time(time_s, lines, "order, fraction arrived", axis)
        text = "Length of the mean heading, 1 where all fly alike, and fraction at their goals."
        return [_figure(svg, text)]
    parts = {word: numbers[key] for key, word in _PARTS.items()}
    cost = cost_over_time(time_s, numbers["cost"], team.lost_cost, axis)
    return [
        _figure(cost, _cost_text(axis)),
        _figure(
            lines_over_time(time_s, parts, "part of the fitness", axis),
            "Parts of the fitness: velocity matching and clear view are 0 in a V, the upwash is "
            "about the number of UAVs less one.",
        ),
    ]


def _cost_text(axis: TimeAxis) -> str:
    searches = counted(len(axis.searches), "search", "searches")
    found = "No V." if math.isnan(axis.solved_s) else f"The first V after {axis.solved_s:.1f} s."
    return f"Cost of the formation, 0 for a V; {searches}. {found}"


def _distance_chart(
    team: LoggedTeam, paths: dict[str, RecordedTrajectory], start_s: float, axis: TimeAxis
) -> list[str]:
    if len(paths) < 2:
        return []
    times, min_distances = _min_distances(list(paths.values()))
    if not np.isfinite(min_distances).any():
        return []
    svg = distance_over_time(times - start_s, min_distances, team.separation_m, axis)
    nearest = int(np.nanargmin(min_distances))
    text = (
        "Minimum distance between any two UAVs, those on the ground included: "
        f"{min_distances[nearest]:.2f} m at {times[nearest] - start_s:.1f} s."
    )
    if math.isfinite(team.separation_m):
        text += f" {'Plans keep' if team.topic == FORMATION else 'ORCA keeps'} the dashed distance."
    return [_figure(svg, text)]


def _min_distances(paths: Sequence[RecordedTrajectory]) -> tuple[Array, Array]:
    """Returns times (T,) s and the minimum distances (T,) m; NaN where fewer than two are known."""
    start_s = min(float(path.time_s[0]) for path in paths)
    end_s = max(float(path.time_s[-1]) for path in paths)
    steps = int(min((end_s - start_s) / _STEP_S, _MAX_STEPS))
    times = np.linspace(start_s, end_s, steps + 1)
    positions = np.stack([path.positions_at(times) for path in paths], axis=1)
    min_distances = np.full(len(times), np.inf)
    for number in range(len(paths) - 1):
        apart = np.linalg.norm(positions[:, number + 1 :] - positions[:, number, None], axis=2)
        min_distances = np.minimum(
            min_distances, np.where(np.isnan(apart), np.inf, apart).min(axis=1)
        )
    return times, np.where(np.isfinite(min_distances), min_distances, np.nan)


def _energy_chart(flight: LoggedFlight) -> list[str]:
    used = {
        each.name: each.energy_j / _J_PER_WH for each in flight.uavs if math.isfinite(each.energy_j)
    }
    if not used:
        return []
    text = f"Energy that the batteries supplied, {sum(used.values()):.1f} Wh in all."
    return [_figure(energy_bars(used), text)]


def _figure(svg: str, caption: str) -> str:
    return chart_figure(svg, f"<figcaption>{caption}</figcaption>")
