"""Common tasks with sensors take few lines, each a script that runs as it stands."""

import ast
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

TASKS = Path(__file__).parent / "tasks"
MAX_LINES = {"read_a_lidar": 4, "save_depth_image": 4}
"""Lines of code of each task, without its docstring and empty lines."""


def lines_of(script):
    docstring = ast.get_docstring(ast.parse(script), clean=False) or ""
    code = script.replace(f'"""{docstring}"""', "")
    return [line for line in code.splitlines() if line.strip() and not line.startswith("#")]


def run(name, folder):
    done = subprocess.run(
        [sys.executable, "-W", "error", TASKS / f"{name}.py"],
        check=False,
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=900,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.parametrize("name", MAX_LINES)
def test_a_task_takes_few_lines(name):
    assert len(lines_of((TASKS / f"{name}.py").read_text())) <= MAX_LINES[name]


def test_a_lidar_is_read(tmp_path):
    nearest, unit, points = run("read_a_lidar", tmp_path).split(maxsplit=2)
    assert 0.0 < float(nearest) < 60.0
    assert unit == "m"
    assert points.endswith(", 3)\n")


def test_a_depth_image_is_saved(tmp_path):
    run("save_depth_image", tmp_path)
    depth = np.asarray(Image.open(tmp_path / "depth.png"))
    assert depth.shape == (480, 640)
    assert 300 < depth[depth > 0].min() < 60_000
