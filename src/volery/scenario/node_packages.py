"""Packages of extras that the shipped nodes of a scenario need, known without importing a node.

So the card of a scenario that cannot start says what to install, and the scenario is refused before
anything is built.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib import invalidate_caches
from importlib.util import find_spec

from volery.core.errors import ScenarioError
from volery.core.extras import import_extra
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
    """Returns which packages the nodes of a scenario lack, with the command; empty: none.

    A package that was installed while this process runs counts.
    """
    invalidate_caches()
    missing = [need for need in _needs(scenario) if not _is_installed(need.module)]
    if not missing:
        return ""
    needs = ", ".join(f"{need.node} needs {need.package}" for need in missing)
    extras = ",".join(sorted({need.extra for need in missing}))
    return f'{needs}: pip install "volery[{extras}]"'


def check_packages(scenario: Scenario) -> None:
    """Imports the packages that the scenario's nodes need.

    Raises `ScenarioError` if some are not installed or cannot be imported.
    """
    missing = missing_packages(scenario)
    if missing:
        raise ScenarioError(f"{scenario.name}: {missing}")
    for need in _needs(scenario):
        what = f"{scenario.name}: {need.node}"
        import_extra(what, need.module, need.package, need.extra, ScenarioError)


def _needs(scenario: Scenario) -> list[NodePackage]:
    """Returns the packages that the scenario's nodes need, each once per node."""
    found = {
        need: None
        for entry in scenario.node_entries
        for need in NODE_PACKAGES
        if is_same_node(entry.node, need.node) and need.is_used(entry)
    }
    return list(found)


def _is_installed(module: str) -> bool:
    try:
        spec = find_spec(module)
    except (ImportError, ValueError):
        return False
    return spec is not None and spec.origin is not None  # a mere folder has no origin
