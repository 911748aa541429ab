"""Expectations of a flight: `[[expect]]` in a scenario.

They change nothing in the flight; `volery.verdicts` judges it by them.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import Annotated, Any, Literal, Self, TypeAlias

from pydantic import Field, model_validator

from volery.scenario.base import Data, NonNegative, Positive, Vector2, check_rectangle
from volery.scenario.faults import SimulatedTime
from volery.scenario.formulas import is_invariant, parse_formula

_Fraction = Annotated[float, Field(ge=0.0, le=1.0)]
_Text = Annotated[str, Field(min_length=1, max_length=2000)]
_Path = Annotated[str, Field(pattern=r"^/?[A-Za-z_]\w*(/[A-Za-z_]\w*)*$", max_length=200)]
_Mode = Literal[
    "landed",
    "take_off",
    "hold",
    "go_to",
    "velocity",
    "land",
    "return",
    "low_level",
    "crashed",
    "trajectory",
]


class _Expectation(Data):
    name: Annotated[str, Field(min_length=1, max_length=80)] | None = None
    """Name in reports; default: the expectation in words."""
    uavs: tuple[str, ...] = ()
    """Names of the UAVs that it is about; empty: all."""

    def describe(self) -> str:
        """Returns the name, or the expectation in words."""
        words = self.name or self._words()
        if self.name is None and self.uavs:
            words += f" ({', '.join(self.uavs)})"
        return words

    def decided_s(self, moment_s: float) -> float:  # noqa: ARG002
        """Returns the simulated time, s, from which a failure is final; inf: the end of the flight.

        moment_s: the moment that the verdict gives, s.
        """
        by_s: float | None = getattr(self, "by_s", None)
        return math.inf if by_s is None else by_s

    def _words(self) -> str:
        return str(getattr(self, "kind", ""))


class _Always(_Expectation):
    """An expectation that holds throughout the flight."""

    def decided_s(self, moment_s: float) -> float:
        """Returns the moment: it has failed for good."""
        return moment_s


class _Windowed(_Always):
    """An expectation that holds at all samples of a part of the flight."""

    from_s: SimulatedTime = 0.0
    """Simulated time from which it holds."""
    until_s: SimulatedTime | None = None
    """Simulated time until which it holds; None: the end."""

    @model_validator(mode="after")
    def _ends_after_it_begins(self) -> Self:
        if self.until_s is not None and self.until_s <= self.from_s:
            raise ValueError(f"until_s = {self.until_s} must be later than from_s = {self.from_s}")
        return self


class ContactFreeExpectation(_Always):
    """No UAV touches a tree, a solid or another UAV, or hits the ground."""

    kind: Literal["no_contact"] = "no_contact"
    """No contact, except for landings."""

    def _words(self) -> str:
        return "no contact"


class CrashFreeExpectation(_Always):
    """No UAV crashes; a contact that it survives is allowed."""

    kind: Literal["no_crash"] = "no_crash"
    """No crash."""

    def _words(self) -> str:
        return "no crash"


class ArrivalExpectation(_Expectation):
    """Each UAV comes near a position."""

    kind: Literal["arrives"] = "arrives"
    """Arrival at a position."""
    position_m: Annotated[tuple[float, ...], Field(min_length=2, max_length=3)]
    """Position x, y or x, y, z, map."""
    within_m: Positive = 1.0
    """Distance that counts as arrived; without z, a horizontal one."""
    by_s: SimulatedTime | None = None
    """Simulated time by which it arrives; None: the end."""

    def _words(self) -> str:
        where = ", ".join(f"{x:g}" for x in self.position_m)
        return f"arrives within {self.within_m:g} m of ({where}){_by(self.by_s)}"


class SeparationExpectation(_Windowed):
    """UAVs keep a distance from each other."""

    kind: Literal["separation"] = "separation"
    """Distance between UAVs."""
    at_least_m: Positive
    """Minimum distance between the positions of two UAVs."""

    def _words(self) -> str:
        return f"separation >= {self.at_least_m:g} m"


class ClearanceExpectation(_Windowed):
    """UAVs keep a distance from trees and solids."""

    kind: Literal["clearance"] = "clearance"
    """Distance to trees and solids."""
    at_least_m: Annotated[float, Field(gt=0.0, le=10.0)]
    """Minimum distance of a UAV's position from them; at most 10 m."""

    def _words(self) -> str:
        return f"clearance >= {self.at_least_m:g} m"


class LimitsExpectation(_Windowed):
    """UAVs stay inside a fence, a corridor or a range of heights."""

    kind: Literal["inside"] = "inside"
    """Stay within limits."""
    region_m: tuple[float, float, float, float] | None = None
    """x_min, y_min, x_max, y_max of a fence, map."""
    corridor_m: Annotated[tuple[Vector2, ...], Field(min_length=2)] | None = None
    """Points x, y of the middle line of a corridor, map."""
    radius_m: Positive | None = None
    """Greatest horizontal distance from the middle line of the corridor."""
    height_m: Vector2 | None = None
    """Minimum and maximum z, map."""

    @model_validator(mode="after")
    def _has_limits(self) -> Self:
        if self.region_m is None and self.corridor_m is None and self.height_m is None:
            raise ValueError("give 'region_m', 'corridor_m' with 'radius_m', or 'height_m'")
        if (self.corridor_m is None) != (self.radius_m is None):
            raise ValueError("'corridor_m' and 'radius_m' belong together")
        if self.region_m is not None:
            check_rectangle(self.region_m)
        _check_order(self.height_m, "height_m")
        return self

    def _words(self) -> str:
        parts = []
        if self.region_m is not None:
            parts.append("the box ({:g}, {:g}) to ({:g}, {:g})".format(*self.region_m))
        if self.radius_m is not None:
            parts.append(f"{self.radius_m:g} m of the corridor")
        if self.height_m is not None:
            parts.append("z from {:g} to {:g} m".format(*self.height_m))
        return "stays inside " + ", ".join(parts)


class SpeedExpectation(_Windowed):
    """UAVs fly no faster than a limit."""

    kind: Literal["speed"] = "speed"
    """Speed limit."""
    at_most_m_s: Positive
    """Greatest speed, m/s."""

    def _words(self) -> str:
        return f"speed <= {self.at_most_m_s:g} m/s"


class BatteryExpectation(_Windowed):
    """Batteries keep a charge."""

    kind: Literal["battery"] = "battery"
    """Charge of the batteries."""
    at_least: _Fraction
    """Minimum remaining fraction of the capacity."""

    def _words(self) -> str:
        return f"battery >= {100.0 * self.at_least:g} %"


class ModesExpectation(_Expectation):
    """Each UAV enters flight modes in an order; others may come between them."""

    kind: Literal["modes"] = "modes"
    """Flight modes in order."""
    modes: Annotated[tuple[_Mode, ...], Field(min_length=1)]
    """Modes, such as `["take_off", "land", "landed"]`; the first may be that of the start."""
    by_s: SimulatedTime | None = None
    """Simulated time by which the last one is entered; None: the end."""

    def _words(self) -> str:
        return f"{', '.join(self.modes)}{_by(self.by_s)}"


class TopicRateExpectation(_Windowed):
    """Messages arrive on a topic at a rate."""

    kind: Literal["topic_rate"] = "topic_rate"
    """Rate of a topic."""
    topic: _Path
    """Absolute topic, or one below each UAV's namespace, such as `slam/pose`."""
    at_least_hz: Positive
    """Minimum number of messages per simulated second, in each window."""
    window_s: Annotated[float, Field(gt=0.0, le=3600.0)] = 1.0
    """Length of the windows, which follow each other."""

    def decided_s(self, moment_s: float) -> float:
        """Returns the end of the window that begins at the moment."""
        return moment_s + self.window_s

    def _words(self) -> str:
        return f"{self.topic} >= {self.at_least_hz:g} Hz"


class TopicValueExpectation(_Windowed):
    """A field of the messages of a topic has certain values."""

    kind: Literal["topic_value"] = "topic_value"
    """Values of a topic's field."""
    topic: _Path
    """Absolute topic, or one below each UAV's namespace, such as `slam/status`."""
    field: Annotated[str, Field(pattern=r"^\w+(\.\w+)*$", max_length=200)] = "data"
    """Path of the field: `pose.position.z`; of text that is JSON, also the keys in it:
    `data.phase`."""
    at_least: float | None = None
    """Minimum value of the field, over the window."""
    at_most: float | None = None
    """Greatest value of the field, over the window."""
    equals: bool | float | str | None = None
    """The value itself, instead of bounds."""
    when: Literal["always", "eventually", "at_end"] = "eventually"
    """In all messages of the window, in at least one of them, or in the last one."""

    @model_validator(mode="after")
    def _has_bounds(self) -> Self:
        bounds = self.at_least is not None or self.at_most is not None
        if bounds == (self.equals is not None):
            raise ValueError("give 'at_least', 'at_most' or both, or 'equals'")
        if self.at_least is not None and self.at_most is not None:
            _check_order((self.at_least, self.at_most), "at_least and at_most")
        return self

    def decided_s(self, moment_s: float) -> float:
        """Returns the time after which no value can come that passes."""
        if self.when == "always":
            return moment_s
        return math.inf if self.until_s is None else self.until_s

    def _words(self) -> str:
        parts = [f"= {self.equals}"] if self.equals is not None else []
        parts += [f">= {self.at_least:g}"] if self.at_least is not None else []
        parts += [f"<= {self.at_most:g}"] if self.at_most is not None else []
        when = {"always": "always", "eventually": "once", "at_end": "at the end"}[self.when]
        until = "" if self.until_s is None else _by(self.until_s)
        return f"{self.topic} {self.field} {' and '.join(parts)}, {when}{until}"


class AreaExpectation(_Expectation):
    """The UAVs fly over an area together."""

    kind: Literal["area"] = "area"
    """Area under the paths."""
    at_least_m2: Positive
    """Ground area within `radius_m` of any path, in cells of 0.5 m."""
    radius_m: Positive = 2.0
    """Distance from a path that counts as covered."""

    def _words(self) -> str:
        return f"area >= {self.at_least_m2:g} m2"


class EstimateErrorExpectation(_Expectation):
    """Estimated trajectories are near the true ones."""

    kind: Literal["estimate_error"] = "estimate_error"
    """Absolute trajectory error."""
    at_most_m: Positive
    """Greatest RMSE of a UAV's estimated positions after alignment; from `slam/pose`, `slam/odom`
    or `odom`."""

    def _words(self) -> str:
        return f"estimate error <= {self.at_most_m:g} m"


class NeesExpectation(_Expectation):
    """Estimated positions are consistent with their covariances."""

    kind: Literal["nees"] = "nees"
    """Normalized estimation error squared."""
    at_most: Positive
    """Greatest mean NEES of a UAV's positions, from the pose at its start; that of a consistent
    estimator is 3."""
    at_least: NonNegative = 0.0
    """Minimum mean NEES; below it, covariances are too large."""

    @model_validator(mode="after")
    def _bounds_are_ordered(self) -> Self:
        _check_order((self.at_least, self.at_most), "at_least and at_most")
        return self

    def _words(self) -> str:
        low = f"{self.at_least:g} <= " if self.at_least else ""
        return f"{low}NEES <= {self.at_most:g}"


class LogMessageExpectation(_Always):
    """No node logs a warning or worse."""

    kind: Literal["no_log_message"] = "no_log_message"
    """No warnings or errors of nodes."""
    level: Literal["warn", "error", "fatal"] = "warn"
    """Level from which messages on `/rosout` count."""
    contains: str = ""
    """Text that counting messages contain; empty: all count."""

    def _words(self) -> str:
        about = f" with '{self.contains}'" if self.contains else ""
        return f"no log message of level {self.level} or above{about}"


class RealTimeFactorExpectation(_Expectation):
    """The simulation keeps up; the only expectation that differs when a run is repeated."""

    kind: Literal["real_time_factor"] = "real_time_factor"
    """Speed of the simulation."""
    at_least: Positive
    """Minimum simulated time per wall time, over the whole flight."""

    def _words(self) -> str:
        return f"real-time factor >= {self.at_least:g}"


class PredicateExpectation(_Expectation):
    """A Python function judges the flight."""

    kind: Literal["predicate"] = "predicate"
    """Function of your own."""
    function: Annotated[str, Field(pattern=r"^[A-Za-z_][\w.]*:[A-Za-z_]\w*$")]
    """`module:function`. Its parameters name what it needs of the flight, as for the metrics of a
    study; it returns whether the flight passes, or the margin."""
    parameters: dict[str, Any] = Field(default_factory=dict)
    """Further arguments of the function."""
    topics: tuple[_Path, ...] = ()
    """Topics whose messages the function reads, as `topics`: absolute ones, or ones below each
    UAV's namespace."""

    def _words(self) -> str:
        return self.function


class FormulaExpectation(_Expectation):
    """A temporal formula holds for each UAV, at the beginning of its flight."""

    kind: Literal["formula"] = "formula"
    """Signal temporal logic."""
    formula: _Text
    """Such as `always(z > 1 and speed < 5, 5, 40)`; see `scenario.formulas`."""

    @model_validator(mode="after")
    def _can_be_read(self) -> Self:
        parse_formula(self.formula)
        return self

    def decided_s(self, moment_s: float) -> float:
        """Returns the moment for what must always hold, else inf."""
        return moment_s if is_invariant(parse_formula(self.formula)) else math.inf

    def _words(self) -> str:
        return re.sub(r"\s+", " ", self.formula.strip())


Expectation: TypeAlias = Annotated[
    ContactFreeExpectation
    | CrashFreeExpectation
    | ArrivalExpectation
    | SeparationExpectation
    | ClearanceExpectation
    | LimitsExpectation
    | SpeedExpectation
    | BatteryExpectation
    | ModesExpectation
    | TopicRateExpectation
    | TopicValueExpectation
    | AreaExpectation
    | EstimateErrorExpectation
    | NeesExpectation
    | LogMessageExpectation
    | RealTimeFactorExpectation
    | PredicateExpectation
    | FormulaExpectation,
    Field(discriminator="kind"),
]


def names_of(expectations: Sequence[Expectation]) -> tuple[str, ...]:
    """Returns a name for each expectation; equal ones are numbered: `no contact`, `... #2`."""
    counts: dict[str, int] = {}
    names = []
    for expectation in expectations:
        words = expectation.describe()
        counts[words] = counts.get(words, 0) + 1
        names.append(words if counts[words] == 1 else f"{words} #{counts[words]}")
    return tuple(names)


def _by(time_s: float | None) -> str:
    return "" if time_s is None else f" by {time_s:g} s"


def _check_order(bounds: Vector2 | None, key: str) -> None:
    if bounds is not None and bounds[0] > bounds[1]:
        raise ValueError(f"{key}: {bounds[0]:g} is above {bounds[1]:g}")
