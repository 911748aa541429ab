"""Tests that files, names in files, targets and options in CONTRIBUTING and RELEASING exist."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
FOLDERS = (ROOT, ROOT / "src/volery", ROOT / "tests/conformance/bridges")
"""Paths in the text are below one of these."""
TEXTS = {
    name: (ROOT / name).read_text(encoding="utf-8") for name in ("CONTRIBUTING.md", "RELEASING.md")
}
WRITTEN = ("runs/", "dist/", "docs/pictures/")
"""Results of commands."""
NAMES_IN_FILES = {
    "src/volery/sensors/samples.py": ("Samples",),
    "src/volery/scenario/navigation.py": ("NavigationSensor",),
    "src/volery/scenario/sensors.py": ("Sensor",),
    "src/volery/runtime/construction/sensor_suites.py": ("RESULT_OF",),
    "src/volery/runtime/construction/sensors.py": ("_Builder", "build"),
    "src/volery/publishing/navigation_messages.py": ("NAVIGATION_TOPICS",),
    "src/volery/core/listener.py": ("open_listener",),
    "src/volery/core/network_access.py": ("tend",),
    "src/volery/core/preamble.py": ("Preamble",),
    "tests/conformance/test_sensors.py": ("KINDS",),
    "tests/conformance/bridges/bridge_bench.py": ("Client", "Bench", "cannot"),
    "tests/conformance/bridges/conftest.py": ("BENCHES",),
    "tests/hostile/test_values_in_flight.py": ("NODES",),
    "tests/node_bench.py": ("NodeBench",),
    "tests/unit/vehicle/test_drag.py": ("TILTS_DEG",),
}
"""Names of the recipes and where they are defined."""


def paths(text: str) -> set[str]:
    """Paths with a folder between backquotes or in commands."""
    found = re.findall(r"(?<![\w./-])((?:\.?[\w-]+/)+[\w-]+(?:\.\w+)*)(?![\w/*-])", text)
    return {
        path
        for path in found
        if "NAME" not in path and "PATH" not in path and not path.startswith((".venv/", *WRITTEN))
    }


@pytest.mark.parametrize("name", TEXTS)
def test_paths_exist(name):
    links = re.compile(r"https?://\S+|github\.com\S+")
    found = paths(links.sub("", TEXTS[name]))
    assert len(found) > 3
    missing = [p for p in sorted(found) if not any((folder / p).exists() for folder in FOLDERS)]
    assert missing == []


@pytest.mark.parametrize("path", NAMES_IN_FILES)
def test_names_of_the_recipes_are_defined(path):
    code = (ROOT / path).read_text(encoding="utf-8")
    for name in NAMES_IN_FILES[path]:
        assert re.search(rf"^\s*(class|def) {name}\b|^\s*{name}\b.*=", code, re.MULTILINE), name
        assert re.search(rf"`[\w.]*\b{name}\b", TEXTS["CONTRIBUTING.md"]), name


@pytest.mark.parametrize("name", TEXTS)
def test_make_targets_exist(name):
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    lines = re.findall(r"(?:^|`)make ([a-z -]+?)(?:`| *#|$)", TEXTS[name], re.MULTILINE)
    targets = {target for line in lines for target in line.split()}
    assert len(targets) > 1
    assert [t for t in targets if not re.search(rf"^{t}:", makefile, re.MULTILINE)] == []


def test_each_recipe_fits_a_page():
    recipes = re.split(r"^## ", TEXTS["CONTRIBUTING.md"], flags=re.MULTILINE)[1:]
    lines = {recipe.splitlines()[0]: len(recipe.splitlines()) for recipe in recipes}
    assert {"Add a sensor", "Add an airframe", "Add a node", "Add a bridge"} <= lines.keys()
    assert max(lines.values()) < 50
