"""The document on scenarios in Python: its examples run as they stand, one after the other."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from volery import load_scenario

PAGE = Path(__file__).parents[2] / "docs" / "scenarios_in_python.md"


def test_the_examples_run(tmp_path):
    blocks = re.findall(r"^```python\n(.*?)^```", PAGE.read_text("utf-8"), re.DOTALL | re.MULTILINE)
    assert len(blocks) >= 7
    script = tmp_path / "examples.py"
    script.write_text("\n".join(blocks), encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "-W", "error", script.name],
        check=False,
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=900,
    )
    assert done.returncode == 0, done.stderr
    first, changed, refused, count, *scans, last = done.stdout.splitlines()
    x_m = float(first.strip("[ ]").split()[0])
    assert x_m == pytest.approx(20.0, abs=0.5)  # the last of four UAVs in a line
    assert changed == "moderate 90.0"
    assert (
        "key 'world.wind.turbulence': 'none', 'light', 'moderate' or 'severe' is needed" in refused
    )
    assert count == "18"
    assert sorted(scans) == [f"/uav{k} has 20 scans" for k in (2, 3)]  # uav1's LIDAR fails
    assert last.startswith("[")
    assert load_scenario(tmp_path / "wood.toml").uav_count == 3
