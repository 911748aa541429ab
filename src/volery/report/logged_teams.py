"""Reads what a team's node publishes in a log, and the energy that UAVs use."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from volery.autonomy.swarm.formation_member import MemberPhase
from volery.autonomy.swarm.orca import OrcaSettings
from volery.autonomy.swarm.v_formation import (
    LOST_COST,
    MIN_DISTANCE,
    WING_SPAN_M,
    VFormationPhase,
)
from volery.core.arrays import Array
from volery.core.clock import NS_PER_S

FORMATION, FLOCK = "/v_formation/status", "/flock/status"
MEMBER = "formation_member/status"
"""Topic, below a UAV's namespace, of the status of a formation that no node leads."""
_NUMBERS = {
    FORMATION: ("cost", "velocity_matching", "clear_view", "upwash", "searches", "time_to_v_s"),
    FLOCK: ("order", "arrived", "members"),
}
"""Numbers of a status that are drawn, by topic."""
_PHASES = [str(phase) for phase in (*VFormationPhase, *MemberPhase)]
_SENSIBLE = 1e6
"""Larger numbers are drawn as this one."""
_LONGEST_GAP_S = 5.0
"""Gap between battery states above which the power between them is unknown, s."""


@dataclass(frozen=True)
class LoggedTeam:
    """What the node of a team published, K times."""

    topic: str
    """`FORMATION`, also of a UAV's own status of one, or `FLOCK`."""
    time_s: Array
    """(K,) s, of the log."""
    numbers: Mapping[str, Array]
    """(K,) each, by the key of the status; NaN where it has none."""
    phases: Sequence[str]
    """K phases of a formation; empty texts for a flock."""
    members: Sequence[frozenset[str]]
    """K sets of the names of UAVs in a formation; empty for a flock, which publishes a number."""
    separation_m: float = math.nan
    """Distance between UAVs that the node plans to keep, m; NaN if there is none."""
    lost_cost: float = math.nan
    """Cost above which the node counts a formation as lost; NaN if unknown."""

    @property
    def search_times_s(self) -> Array:
        """Times at which searches begin, s."""
        if "searches" not in self.numbers:
            return np.empty(0)
        known = np.nan_to_num(self.numbers["searches"])
        return self.time_s[np.diff(known, prepend=0.0) > 0.0]

    @property
    def time_to_v_s(self) -> float:
        """Time of the first V, s; NaN if there is none."""
        times = self.numbers.get("time_to_v_s", np.empty(0))
        found = times[np.isfinite(times)]
        return float(found[0]) if len(found) else math.nan

    def moments(self, count: int) -> list[int]:
        """Returns numbers of statuses to draw: of new phases and the last one.

        Where these are more than `count`, some are left out; where fewer, some between are added.
        """
        last = len(self.time_s) - 1
        phases = self.phases
        chosen = {0, last} | {k for k in range(1, last) if phases[k] != phases[k - 1]}
        if len(chosen) > count:
            numbers = sorted(chosen)
            return [numbers[k] for k in np.linspace(0, len(numbers) - 1, count).round().astype(int)]
        while len(chosen) < min(count, last + 1):
            numbers = sorted(chosen)
            gaps = np.diff(self.time_s[numbers]) * (np.diff(numbers) > 1)
            longest = int(np.argmax(gaps))
            chosen.add((numbers[longest] + numbers[longest + 1]) // 2)
        return sorted(chosen)


@dataclass
class TeamLog:
    """Collects the statuses of one team from a log; the first topic with one is taken."""

    topic: str = ""
    """Topic of the statuses."""
    _rows: list[tuple[float, ...]] = field(default_factory=list)
    _phases: list[str] = field(default_factory=list)
    _members: list[frozenset[str]] = field(default_factory=list)

    def add(self, topic: str, time_ns: int, message: Any) -> None:
        """Adds a status; one that is not a JSON object is left out."""
        if self.topic not in ("", topic):
            return
        try:
            status = json.loads(message.data)
            numbers = tuple(_number(status.get(key)) for key in _NUMBERS[_kind(topic)])
        except (AttributeError, ValueError, TypeError, RecursionError):
            return
        self.topic = topic
        self._rows.append((time_ns / NS_PER_S, *numbers))
        phase, members = status.get("phase"), status.get("members")
        self._phases.append(str(phase) if phase in _PHASES else "")
        self._members.append(frozenset(map(str, members if isinstance(members, list) else ())))

    def team(self, scenario: Mapping[str, Any]) -> LoggedTeam | None:
        """Returns the team; None without statuses. scenario: content of the recorded one."""
        if not self._rows:
            return None
        table = np.array(self._rows)
        kind = _kind(self.topic)
        numbers = dict(zip(_NUMBERS[kind], table[:, 1:].T, strict=True))
        parameters = _parameters(self.topic.split("/")[-2], scenario)
        bounds = (math.nan, math.nan) if parameters is None else _bounds(kind, parameters)
        return LoggedTeam(kind, table[:, 0], numbers, self._phases, self._members, *bounds)


@dataclass
class EnergyMeter:
    """Integrates the power of one UAV's battery."""

    energy_j: float = math.nan
    """NaN before two battery states."""
    _last: tuple[float, float] | None = None

    def add(self, time_ns: int, message: Any) -> None:
        """Adds a BatteryState; its current is negative while it discharges."""
        now_s, power = time_ns / NS_PER_S, -float(message.voltage) * float(message.current)
        if not math.isfinite(power):
            return
        if self._last is not None and 0.0 < now_s - self._last[0] <= _LONGEST_GAP_S:
            used = 0.5 * (power + self._last[1]) * (now_s - self._last[0])
            self.energy_j = used + (0.0 if math.isnan(self.energy_j) else self.energy_j)
        self._last = now_s, power


def _kind(topic: str) -> str:
    """Returns the topic of which a status is of the kind."""
    return FORMATION if topic.endswith(MEMBER) else topic


def _number(value: Any) -> float:
    """Returns a number of a status within sensible limits; NaN if it is none."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return math.nan
    return float(max(min(value, _SENSIBLE), -_SENSIBLE))  # in this order, NaN remains


def _parameters(node: str, scenario: Mapping[str, Any]) -> Mapping[str, Any] | None:
    """Returns the parameters of a node of a recorded scenario, which may hold anything."""
    types = scenario.get("types")
    parts = [scenario, *(types.values() if isinstance(types, dict) else ())]
    for nodes in (part.get("nodes") for part in parts if isinstance(part, dict)):
        for each in nodes if isinstance(nodes, list) else ():
            if isinstance(each, dict) and each.get("node") == node:
                parameters = each.get("parameters", {})
                return parameters if isinstance(parameters, dict) else None
    return None


def _bounds(topic: str, parameters: Mapping[str, Any]) -> tuple[float, float]:
    """Returns the distance that a node plans to keep and the cost of a lost formation."""
    if topic == FLOCK:
        is_orca = parameters.get("behaviour") == "orca"
        return OrcaSettings().distance_m if is_orca else math.nan, math.nan
    span = _number(parameters.get("wing_span_m", WING_SPAN_M))
    distance = _number(parameters.get("min_distance", MIN_DISTANCE))
    return span * distance, _number(parameters.get("lost_cost", LOST_COST))
