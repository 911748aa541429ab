"""Builds a scenario of an uploaded file and its world, in a separate process.

    python -m volery.server.uploads.validation grid_map FOLDER/map.png yard yard.png

It reads untrusted files with bounds on memory and time, apart from a running simulation. It prints
one JSON object: `{}` or `{"error": "one clear message"}`.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

from volery.core.errors import VoleryError
from volery.scenario.catalog import ScenarioCatalog
from volery.server.bounded_process import bound_this_process
from volery.server.uploads.kinds import BOUNDS, SCENARIO
from volery.server.uploads.scenario_builder import toml_of


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
    from volery.server.uploads.scenario_file import check_contents, text_of

    target = path.parent / ScenarioCatalog.FILE
    own = kind == SCENARIO
    text = text_of(path, name) if own else toml_of(kind, path, name, called)
    target.write_text(text, encoding="utf-8")
    scenario = load_scenario(target, confined=True)
    if own:
        check_contents(scenario)
        check_types(scenario)
    terrain = build_terrain(scenario)
    city = build_city(scenario, terrain)
    forest = build_forest(scenario, terrain, city)
    scene = build_scene(scenario, terrain, forest, city)
    try:
        place_fleet(scenario, scene, terrain)
    finally:
        scene.close()


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
