"""Every example runs as it stands, and says something."""

import subprocess
import sys
from pathlib import Path

import pytest

NEEDS_A_RUN = {
    "06_fly_over_rosbridge",
    "09_bring_your_own_planner",
    "09_bring_your_own_planner_ros_tcp",
    "13_mavros_offboard",
}
"""They join a simulation that runs already: test_run_with_bridges.py flies them."""
EXAMPLES = sorted(
    path
    for path in (Path(__file__).parents[2] / "examples").glob("*.py")
    if path.stem not in NEEDS_A_RUN
)


@pytest.mark.slow
@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_example(example, tmp_path):
    done = subprocess.run(
        [sys.executable, "-W", "error", str(example)],
        check=False,
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=900,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip()
    assert not done.stderr


def test_there_are_examples():
    assert len(EXAMPLES) >= 3
