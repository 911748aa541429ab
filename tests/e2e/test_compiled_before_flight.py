"""A first start compiles everything before its clock starts: nothing in flight."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

_TESTS = Path(__file__).parent.parent
_FLY = """
import json, sys
from compile_watch import NeedsWatch
from volery import Simulation, load_scenario
from volery.graph.messages import String
from volery.scenario import overrides
from volery.runtime.warmup.requirements import needs_of
from volery.runtime.warmup.tasks import do

watch, received = NeedsWatch(), {}
scenario = load_scenario(sys.argv[1])
if sys.argv[1] == "forest_search":  # two use all kernels of a team
    scenario = overrides.apply(scenario, uavs=2)
for task in needs_of(scenario):  # a first start runs them; a later one loads when it flies
    do(task)
with Simulation(scenario) as simulation:
    before = len(watch.needed)
    for uav in simulation.vehicles.names:
        for name in ("slam/status", "planning/goal_status"):
            note = lambda p: received.update({p.topic: p.message.data})
            simulation.graph.subscribe(f"/{uav}/{name}", note, String)
    simulation.run(float(sys.argv[2]))
print(json.dumps([before, watch.needed[before:], received]))
"""
_PARTS = {f"volery.core.rng.{name} (uint64, int64)" for name in ("normal", "uniform")}
"""Parts of other kernels that Python calls, too: compiled with those, loaded when called."""
_REASON = "a `warmup_tasks` of a node, or `runtime.warmup`, lacks what compiles these"


@pytest.mark.slow
def test_nothing_is_compiled_in_flight() -> None:
    """The search flies until it has closed loops and planned new paths."""
    flights = (("forest_search", 70), ("forest_survey", 8), ("coverage", 8), ("obstacle_field", 6))
    flights += (("v_formation_distributed", 40),)
    received: dict[str, dict[str, str]] = {}
    for scenario, seconds in flights:
        printed = _run("-c", _FLY, scenario, str(seconds))
        before, in_flight, received[scenario] = json.loads(printed.splitlines()[-1])
        assert {*in_flight} <= _PARTS, f"{scenario}: {_REASON}"
        assert before > 50 or scenario != "forest_search"
    states = {topic: json.loads(text) for topic, text in received["forest_search"].items()}
    assert sum(s["closures"] for t, s in states.items() if t.endswith("/slam/status")) > 0
    assert max(s["plans"] for t, s in states.items() if t.endswith("/goal_status")) > 3


@pytest.mark.slow
def test_what_happens_rarely_in_flight_is_compiled_too(tmp_path: Path) -> None:
    """Tracking lost and restored, many divisions of maps: what unit tests have nodes do."""
    needed = tmp_path / "needed.json"
    folder = _TESTS / "unit" / "autonomy"
    names = (
        "slam_node",
        "slam_keyframe_graph",
        "planar_slam",
        "coverage_plans",
        "receding_horizon",
    )
    files = [str(folder / f"test_{name}.py") for name in names]
    _run(
        "-m", "pytest", "-q", "-p", "compile_watch", "-m", "not slow", *files, NEEDED_TO=str(needed)
    )
    assert {*json.loads(needed.read_text())} <= _PARTS, _REASON


def _run(*command: str, **variables: str) -> str:
    paths = [str(_TESTS), os.environ.get("PYTHONPATH", "")]
    done = subprocess.run(
        [sys.executable, *command],
        env={
            **os.environ,
            "PYTHONPATH": os.pathsep.join(filter(None, paths)),
            **variables,
        },
        cwd=_TESTS.parent,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout
