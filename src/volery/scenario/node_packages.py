"""Packages of extras that the shipped nodes of a scenario need, known without importing a node.

So a scenario that cannot start is refused before anything is built, and its card says what to
install.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib.util import find_spec

from volery.core.errors import ScenarioError
from volery.scenario.node_names import is_same_node
from volery.scenario.schema import NodeEntry, Scenario


@dataclass(frozen=True)
class NodePackage:
    """A package that a node imports."""

    node: str
    """Registered name of the node."""
    module: str
    """Module that it imports."""
    package: str
    """Name of the package that holds the module."""
    extra: str
    """Extra of Volery that installs the package."""
    is_used: Callable[[NodeEntry], bool] = lambda _entry: True
    """Whether a node with these parameters imports it."""


def _closes_loops(entry: NodeEntry) -> bool:
    return bool(entry.parameters.get("loop_closures", True))


NODE_PACKAGES = (
    NodePackage("global_planner", "ompl", "ompl", "autonomy"),
    NodePackage("mapping", "pyoctomap", "pyoctomap", "autonomy"),
    NodePackage("slam", "gtsam", "gtsam", "autonomy", _closes_loops),
    NodePackage("planar_slam", "gtsam", "gtsam", "autonomy", _closes_loops),
    NodePackage("tag_detection", "cv2", "opencv-python-headless", "vision"),
    NodePackage("mavlink_autopilot", "pymavlink", "pymavlink", "mavlink"),
    NodePackage("mavlink_autopilot", "fastcrc", "fastcrc", "mavlink"),
)


def missing_packages(scenario: Scenario) -> str:
    """Returns which packages the nodes of a scenario lack, with the command; empty: none."""
    found: dict[NodePackage, None] = {}
    for entry in scenario.node_entries:
        for need in NODE_PACKAGES:
            if is_same_node(entry.node, need.node) and need.is_used(entry):
                found |= {} if _is_installed(need.module) else {need: None}
    if not found:
        return ""
    needs = ", ".join(f"{need.node} needs {need.package}" for need in found)
    extras = ",".join(sorted({need.extra for need in found}))
    return f'{needs}: pip install "volery[{extras}]"'


def check_packages(scenario: Scenario) -> None:
    """Raises `ScenarioError` if a package that the scenario's nodes need is not installed."""
    missing = missing_packages(scenario)
    if missing:
        raise ScenarioError(f"{scenario.name}: {missing}")


def _is_installed(module: str) -> bool:
    try:
        return find_spec(module) is not None
    except (ImportError, ValueError):
        return False
