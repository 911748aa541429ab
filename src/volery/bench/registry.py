"""The benches by name, their bounds, and the form of a result.

A bench is a module of this package with `measure() -> dict[str, float]`.
"""

from __future__ import annotations

import importlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from volery.bench.machine import describe_machine, describe_versions
from volery.core.errors import VoleryError


@dataclass(frozen=True)
class Bound:
    """What a figure must reach on a machine with two cores of the present class."""

    value: float
    at_most: bool = False

    def holds(self, figure: float) -> bool:
        """Whether a figure is within the bound."""
        return figure <= self.value if self.at_most else figure >= self.value

    def __str__(self) -> str:
        return f"{'<=' if self.at_most else '>='} {self.value:,.4g}"


@dataclass(frozen=True)
class Result:
    """Figures of one bench and the machine they were measured on."""

    bench: str
    machine: Mapping[str, str]
    figures: Mapping[str, float]

    def as_dict(self) -> dict[str, Any]:
        """Plain data."""
        machine, figures = dict(self.machine), dict(self.figures)
        return {"bench": self.bench, "machine": machine, "figures": figures}

    def to_json(self) -> str:
        """One JSON object on one line."""
        return json.dumps(self.as_dict())

    @classmethod
    def from_json(cls, text: str) -> Result:
        """A result written by `to_json`. VoleryError if it is none."""
        try:
            return cls.from_dict(json.loads(text))
        except json.JSONDecodeError:
            raise VoleryError(f"not the result of a bench: {text[:80]!r}") from None

    @classmethod
    def from_dict(cls, data: Any) -> Result:
        """A result as plain data. VoleryError if it is none."""
        try:
            figures = {str(k): float(v) for k, v in data["figures"].items()}
            machine = {str(k): str(v) for k, v in data["machine"].items()}
            return cls(str(data["bench"]), machine, figures)
        except (KeyError, TypeError, ValueError, AttributeError):
            raise VoleryError("not the result of a bench: bench, machine, figures") from None


@dataclass(frozen=True)
class Bench:
    """A module to measure with and the bounds of its figures."""

    name: str
    title: str
    bounds: Mapping[str, Bound] = field(default_factory=dict)

    def run(self) -> Result:
        """Measure now."""
        module = importlib.import_module(f"volery.bench.{self.name}")
        figures: dict[str, float] = module.measure()
        return Result(self.name, {**describe_machine(), **describe_versions()}, figures)


BENCHES: dict[str, Bench] = {
    bench.name: bench
    for bench in (
        Bench(
            "lidar",
            "LIDAR: ray casting in a 500 m forest of 5,000 trees, 30 m reach, "
            "batches of 100 UAVs with two scanners of 1081 beams",
            {
                "rays_per_s_1_thread": Bound(6e6),
                "rays_per_s_2_threads": Bound(11e6),
                "ratio_to_embreex_run": Bound(1.3),
                "ratio_to_open3d": Bound(1.8),
            },
        ),
        Bench(
            "fleet",
            "Fleet: the largest at real-time factor 1, each UAV with two planar LIDARs at 40 Hz "
            "(`_64_rings`: one of 64 x 1024 beams at 10 Hz instead), IMU at 200 Hz, physics and "
            "control at 1 kHz",
            {"realtime_uavs": Bound(60.0)},
        ),
        Bench(
            "dynamics",
            "Dynamics: plant and inner control, fused substeps",
            {
                "ns_per_drone_step_n1000": Bound(150.0, at_most=True),
                "us_per_step_n1": Bound(1.5, at_most=True),
            },
        ),
        Bench(
            "start",
            "Start: from the command to the first frame, and memory of the main job",
            {
                "first_frame_s_cold": Bound(20.0, at_most=True),
                "first_frame_s_warm": Bound(3.0, at_most=True),
                "peak_mb_main_job": Bound(700.0, at_most=True),
            },
        ),
    )
}


def find(name: str) -> Bench:
    """A bench by name; VoleryError listing the names there are."""
    if name not in BENCHES:
        raise VoleryError(f"no bench '{name}'; there are {', '.join(BENCHES)}, or all")
    return BENCHES[name]
