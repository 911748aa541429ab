"""Common tasks with logs and results take few lines, each a script that runs as it is."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from volery.bridges.logs.log_writer import create_log
from volery.graph.messages import Odometry
from volery.runtime import Simulation
from volery.scenario.load import load_scenario

FOLDER = Path(__file__).with_name("tasks")
MAX_LINES = {
    "fly_and_plot": 6,
    "monte_carlo": 8,
    "plot_a_log": 3,
    "replay_a_log": 4,
    "table_of_a_log": 3,
}


def lines_of(script: str) -> int:
    """Number of lines of code without the docstring, which is the first line."""
    lines = (line.strip() for line in script.splitlines()[1:])
    return sum(bool(line) and not line.startswith("#") for line in lines)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory) -> Path:
    """The log of a short flight."""
    path = tmp_path_factory.mktemp("recorded") / "flight.mcap"
    log = create_log(path)
    with Simulation(load_scenario("hover")) as simulation:
        simulation.graph.subscribe_all(log.write, lambda topic: topic == "/uav1/odom")
        simulation.run(3.0)
    log.close()
    return path


@pytest.mark.parametrize("task", MAX_LINES)
def test_task_has_few_lines(task):
    text = (FOLDER / f"{task}.py").read_text()
    assert text.startswith('"""')
    assert text.partition("\n")[0].endswith('."""')
    assert 0 < lines_of(text) <= MAX_LINES[task]


@pytest.mark.parametrize("task", MAX_LINES)
def test_task_runs(task, recorded, tmp_path):
    (tmp_path / "flight.mcap").symlink_to(recorded)
    script = FOLDER / f"{task}.py"
    done = subprocess.run(
        [sys.executable, "-W", "error", str(script)],
        check=False,
        cwd=tmp_path,
        env={**os.environ, "MPLBACKEND": "Agg"},
        capture_output=True,
        text=True,
        timeout=900,
    )
    assert done.returncode == 0, done.stderr
    if task == "monte_carlo":
        assert "count  20.0" in done.stdout
    if task == "table_of_a_log":
        assert "uav1" in done.stdout
    for name in ("height.png", "paths.png"):
        if f'"{name}"' in script.read_text():
            assert (tmp_path / name).read_bytes().startswith(b"\x89PNG")


def test_a_replayed_log_appears_on_the_graph(recorded):
    seen = []
    scenario = load_scenario("hover").with_(types={"f450": {"sensors": [{"kind": "imu"}]}})
    with Simulation(scenario) as simulation:
        simulation.graph.subscribe("/uav1/odom", seen.append, Odometry)
        simulation.replay_log(str(recorded))
        simulation.run(2.0)
    assert len(seen) == 101
