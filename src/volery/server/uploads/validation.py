"""Builds a scenario of an uploaded file and its world, in a separate process.

    python -m volery.server.uploads.validation grid_map FOLDER/map.png yard yard.png

It reads untrusted files with bounds on memory and time, apart from a running simulation. It prints
one JSON object: `{}` or `{"error": "one clear message"}`.

A whole scenario is a TOML file, which keeps its text under the name that the server gives it.
"""

from __future__ import annotations

import json
import re
import sys
import tomllib
from pathlib import Path

from volery.core.errors import ScenarioError, VoleryError, reason_of
from volery.core.toml_text import parse_toml
from volery.scenario.catalog import ScenarioCatalog
from volery.scenario.schema import Scenario
from volery.server.bounded_process import bound_this_process
from volery.server.uploads.kinds import BOUNDS, MAX_UAVS, SCENARIO
from volery.server.uploads.scenario_builder import toml_of

_TABLE = re.compile(r"^\s*\[", re.MULTILINE)
_NAME = re.compile(r"""^[ \t]*(?:name|"name"|'name')[ \t]*=.*$""", re.MULTILINE)


def check(kind: str, path: Path, name: str, called: str) -> None:
    """Writes `scenario.toml` beside `path`, and builds its world.

    Raises VoleryError if the file is invalid, or there is no room for a UAV.
    """
    from volery.runtime.construction.fleet import check_types, place_fleet
    from volery.runtime.construction.worlds import (
        build_city,
        build_forest,
        build_scene,
        build_terrain,
    )
    from volery.scenario.load import load_scenario

    target = path.parent / ScenarioCatalog.FILE
    own = kind == SCENARIO
    text = text_of(path, name) if own else toml_of(kind, path, name, called)
    target.write_text(text, encoding="utf-8")
    scenario = load_scenario(target, confined=True)
    if own:
        _check_contents(scenario)
        check_types(scenario)
    terrain = build_terrain(scenario)
    city = build_city(scenario, terrain)
    forest = build_forest(scenario, terrain, city)
    scene = build_scene(scenario, terrain, forest, city)
    try:
        place_fleet(scenario, scene, terrain)
    finally:
        scene.close()


def text_of(path: Path, name: str) -> str:
    """Returns the TOML of a scenario under another name: uploads are identified by their folders.

    Raises ScenarioError for a file that is not TOML, or has no line `name = "..."` at its top.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")
        before = parse_toml(text)
    except (OSError, ValueError) as error:
        raise ScenarioError(f"{path}: not valid TOML: {reason_of(error)}") from None
    table = _TABLE.search(text)
    top = len(text) if table is None else table.start()
    renamed = _NAME.sub(f'name = "{name}"', text[:top], count=1) + text[top:]
    try:
        is_renamed = parse_toml(renamed) == {**before, "name": name}
    except tomllib.TOMLDecodeError:
        is_renamed = False
    if not is_renamed:
        raise ScenarioError(f'{path}: give the name on a line of its own at the top: name = "..."')
    return renamed


def _check_contents(scenario: Scenario) -> None:
    """Checks an untrusted scenario's demands on the server, except for its world.

    Raises ScenarioError for too many UAVs, and for a node that Volery does not ship.
    """
    from volery.runtime.construction.node_loading import find_node

    if scenario.uav_count > MAX_UAVS:
        raise ScenarioError(
            f"{scenario.name}: {scenario.uav_count} UAVs; at most {MAX_UAVS} are allowed"
        )
    for entry in scenario.node_entries:
        find_node(entry, scenario.name, scenario.access)


def main(kind: str, file: str, name: str, called: str) -> None:
    """Checks a file and prints the result."""
    bound_this_process(BOUNDS)
    result: dict[str, str] = {}
    try:
        check(kind, Path(file), name, called)
    except VoleryError as error:
        result["error"] = str(error)
    except MemoryError:
        result["error"] = f"{file} needs more than {BOUNDS.memory_bytes >> 30} GB of memory"
    sys.stdout.write(json.dumps(result))


if __name__ == "__main__":
    main(*sys.argv[1:])
