"""An uploaded scenario: a TOML file under the name that the server gives it.

text = text_of(Path("scenario.toml"), "my_flight")
"""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

from volery.core.errors import ScenarioError, reason_of
from volery.core.toml_text import parse_toml
from volery.runtime.construction.node_loading import find_node
from volery.scenario.schema import Scenario
from volery.server.uploads.kinds import MAX_UAVS

_TABLE = re.compile(r"^\s*\[", re.MULTILINE)
_NAME = re.compile(r"""^[ \t]*(?:name|"name"|'name')[ \t]*=.*$""", re.MULTILINE)


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


def check_contents(scenario: Scenario) -> None:
    """Checks an untrusted scenario's demands on the server, except for its world.

    Raises ScenarioError for too many UAVs, and for a node that Volery does not ship.
    """
    if scenario.uav_count > MAX_UAVS:
        raise ScenarioError(
            f"{scenario.name}: {scenario.uav_count} UAVs; at most {MAX_UAVS} are allowed"
        )
    for entry in scenario.node_entries:
        find_node(entry, scenario.name, scenario.access)
