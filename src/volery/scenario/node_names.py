"""Names of nodes: `slam`, registered by an installed package, or `my_package.planning:Planner`.

Packages register their nodes as entry points of the group `volery.nodes`; Volery registers its own
in `pyproject.toml`.
"""

from __future__ import annotations

import warnings

from volery.core.entry_points import EntryPoints
from volery.core.errors import ScenarioError
from volery.core.near_names import near_miss

NODE_PATTERN = r"^(\w[\w-]*|[\w.]+:\w+)$"
"""Pattern of node names: a registered name or `module:Class`."""

_REGISTERED = EntryPoints("volery.nodes")
_FORMER_PATHS = {
    "volery.autonomy.avoidance_fsm:RegionAvoidance": "region_avoidance",
    "volery.autonomy.cooperative_search:CooperativeSearch": "cooperative_search",
    "volery.autonomy.coverage.planner_node:CoveragePlanner": "coverage",
    "volery.autonomy.depth_avoidance:DepthAvoidance": "depth_avoidance",
    "volery.autonomy.gap_following:GapFollowing": "gap_following",
    "volery.autonomy.mapping.mapping_node:Mapping": "mapping",
    "volery.autonomy.mapping.merging_node:MapMerging": "map_merging",
    "volery.autonomy.planning.exploring_node:Exploring": "exploration",
    "volery.autonomy.planning.follower:TrajectoryFollower": "trajectory_follower",
    "volery.autonomy.planning.global_planner:GlobalPlanner": "global_planner",
    "volery.autonomy.planning.local_planner:LocalPlanner": "local_planner",
    "volery.autonomy.slam.planar_node:PlanarSlam": "planar_slam",
    "volery.autonomy.slam.slam_node:Slam": "slam",
    "volery.autonomy.target_detection:TargetDetection": "target_detection",
    "volery.autonomy.task_manager:TaskManager": "task_manager",
    "volery.comms.radio_node:RadioNode": "radio",
    "volery.mavlink.node:AutopilotNode": "mavlink_autopilot",
}
"""Names by former paths, which recorded logs contain."""


def registered_nodes() -> dict[str, str]:
    """Returns the `module:Class` of each registered name, sorted by name."""
    return {name: node_path(name) for name in _REGISTERED.names()}


def node_path(node: str) -> str:
    """Returns a node's `module:Class`. Imports nothing.

    Raises `ScenarioError` for a name that no installed package registers. Warns of a node's
    former path.
    """
    if node in _FORMER_PATHS:
        return _moved(node)
    if ":" in node:
        return node
    path = _REGISTERED.find(node)
    if path is None:
        known = _REGISTERED.names()
        hint = near_miss(node, known)
        raise ScenarioError(
            f"no node '{node}'{hint} It is neither module:Class nor one of: {', '.join(known)}"
        )
    return path


def name_of_class(node: type) -> str:
    """Returns the `module:Class` of a class; raises `ValueError` if a module cannot name it."""
    if "." in node.__qualname__:
        raise ValueError(
            f"class {node.__qualname__} is inside a function or a class; a node is a class at the "
            "top level of a module"
        )
    return f"{node.__module__}:{node.__qualname__}"


def name_of_former_path(path: str) -> str:
    """Returns the registered name of a node's former path; other names are returned as they are."""
    return _FORMER_PATHS.get(path, path)


def _moved(node: str) -> str:
    """Returns the present path of a node with this former path."""
    name = _FORMER_PATHS[node]
    path = node_path(name)
    if path != node:
        warnings.warn(f"node '{node}' is named '{name}' now", DeprecationWarning, stacklevel=3)
    return path


def is_same_node(one: str, other: str) -> bool:
    """Returns whether two names refer to the same class; False for unknown names."""
    try:
        return node_path(one) == node_path(other)
    except ScenarioError:
        return False


def node_module(node: str) -> str | None:
    """Returns the module of a node, or None for a name that no installed package registers."""
    try:
        return node_path(node).partition(":")[0]
    except ScenarioError:
        return None
