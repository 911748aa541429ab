"""Common tasks with scenarios take few lines, each a script that flies as it is."""

import ast
import runpy
from pathlib import Path

import numpy as np
import pytest

FOLDER = Path(__file__).with_name("tasks")
MAX_LINES = {"circle_of_100": 6, "fault_in_flight": 5, "own_node": 15, "own_world": 8}


def lines_of(script):
    """Number of lines of code: without docstrings, comments and blank lines."""
    tree = ast.parse(script)
    code = set()
    for node in ast.walk(tree):
        is_text = isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
        if isinstance(node, ast.stmt) and not is_text:
            inner = getattr(node, "body", None)
            end = inner[0].lineno if inner else node.end_lineno + 1
            code.update(range(node.lineno, max(end, node.lineno + 1)))
    lines = script.splitlines()
    return sum(bool(lines[k - 1].strip()) and lines[k - 1].strip()[0] != "#" for k in code)


def flown(task):
    """The simulation of a task's script, after its flight."""
    return runpy.run_path(str(FOLDER / f"{task}.py"), run_name="__main__")["run"]


def kinds_of(run, uav):
    return [event.kind.value for event in run.diagnostics.events if event.uav == uav]


@pytest.mark.parametrize(("task", "max_lines"), MAX_LINES.items())
def test_task_has_few_lines(task, max_lines):
    assert 3 < lines_of((FOLDER / f"{task}.py").read_text(encoding="utf-8")) <= max_lines


def test_lines_are_counted():
    assert lines_of('"""A."""\n\nx = (\n    1,\n)\n\n\ndef f():\n    """B."""\n    return x\n') == 5
    assert lines_of("with a as b:\n    # c\n    b()\n\n    d()\n") == 3


def test_a_hundred_uavs_hover_in_a_circle(capsys):
    run = flown("circle_of_100")
    positions = np.array([uav.position_map for uav in run.uavs.values()])
    assert len(positions) == 100
    assert np.linalg.norm(positions[:, :2], axis=1) == pytest.approx(60.0, abs=0.05)
    assert positions[:, 2] == pytest.approx(2.5, abs=0.2)
    assert capsys.readouterr().out.startswith("100 UAVs at [")


def test_a_fault_ends_the_flight():
    run = flown("fault_in_flight")
    assert kinds_of(run, "uav1")[-3:] == ["fault", "impact", "mode"]
    assert run.uavs["uav1"].position_map[2] < 0.3


def test_an_own_node_flies_its_uav(capsys):
    run = flown("own_node")
    velocity = run.uavs["uav1"].velocity_map
    assert np.linalg.norm(velocity[:2]) == pytest.approx(1.0, abs=0.05)
    assert run.uavs["uav1"].position_map[1] > 2.0  # beyond the centre of its circle
    assert capsys.readouterr().out.startswith("[")


def test_an_own_world_is_built_and_flown():
    run = flown("own_world")
    assert len(run.world.forest) == 200
    assert run.scenario.world.wind.turbulence == "light"
    assert [uav.position_map[2] > 2.0 for uav in run.uavs.values()] == [True] * 3
