"""Starts the nodes that a scenario or a launch profile names; finds functions of expectations.

Importing a module runs its code. `ScenarioAccess` determines which modules may be imported:

- for a scenario made by a program, or a trusted one: all, also in its folder and the working
  folder;
- for a file of the user: shipped and installed ones;
- for a confined one, from a log or an upload: shipped ones, and those that the user's own file
  names.

Installed modules are those that Python finds without the scenario's folder and the working folder.
"""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.machinery import PathFinder
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType
from typing import Any

from volery.core.errors import FAILURES, ScenarioError, VoleryError
from volery.core.near_names import near_miss
from volery.graph.nodes.failures import add_frames, location_of
from volery.graph.nodes.imports import advice_for_missing, provide_ros_imports
from volery.graph.nodes.launch import Launch, make_node
from volery.graph.nodes.node import Context, Node
from volery.scenario.access import ScenarioAccess
from volery.scenario.node_names import node_path
from volery.scenario.schema import NodeEntry, Scenario

_SHIPPED = ("volery.autonomy.", "volery.comms.", "volery.mavlink.")
"""Packages with nodes; some other modules of Volery are programs that an import would start."""


def start_node(
    entry: NodeEntry, context: Context, namespace: str, where: str, access: ScenarioAccess
) -> Node:
    """Imports and constructs a node. Raises `ScenarioError` with the key in the scenario."""
    node_class = find_node(entry, where, access)
    try:
        node: Node = make_node(node_class, Launch(context, namespace, entry.parameters))
    except FAILURES as error:
        _check_base(getattr(error, "obj", None), entry, where)
        raise _broken(f"{where}: node '{entry.node}' does not start", error) from error
    _check_base(node, entry, where)
    unused = node.unused_overrides()
    if unused:
        node.destroy_node()
        raise ScenarioError(
            f"{where}: node '{entry.node}' has no parameter {', '.join(unused)}; "
            f"known: {', '.join(node.declared_parameters())}"
        )
    return node


def _check_base(node: object, entry: NodeEntry, where: str) -> None:
    """Raises `ScenarioError` for a node whose `__init__` does not call that of `Node` first."""
    if isinstance(node, Node) and not hasattr(node, "_context"):
        name = type(node).__name__
        raise ScenarioError(
            f"{where}: node '{entry.node}' does not start: {name}.__init__ does not call the one "
            f'of Node before it does anything else; begin it with: super().__init__("{name.lower()}'
            '", **options)'
        )


def check_nodes(scenario: Scenario) -> None:
    """Imports the classes of all nodes, so that one that fails does so before a world is built.

    Raises `ScenarioError` as `find_node` does.
    """
    for name, kind in scenario.types.items():
        for k, entry in enumerate(kind.nodes):
            find_node(entry, f"{scenario.name}: types.{name}.nodes[{k}]", scenario.access)
    for k, entry in enumerate(scenario.nodes):
        find_node(entry, f"{scenario.name}: nodes[{k}]", scenario.access)


def find_node(entry: NodeEntry, where: str, access: ScenarioAccess) -> type[Any]:
    """Imports a node's class. Raises `ScenarioError` if it is forbidden or not a node."""
    try:
        path = node_path(entry.node)
    except ScenarioError as error:
        raise ScenarioError(f"{where}: {error}") from None
    _check_allowed(entry.node, path, where, access)
    if access.is_trusted:
        with _also_from(*access.module_folders):
            return _find_class(path, where, access)
    with _installed_only(access):
        if is_local(path.partition(":")[0], access):
            raise ScenarioError(
                f"{where}: node '{entry.node}' is a module beside the scenario, which runs only if "
                "you trust it: give --trust, or load_scenario(..., trust=True) in Python"
            )
        return _find_class(path, where, access)


def find_function(path: str, where: str, access: ScenarioAccess) -> Callable[..., Any]:
    """Imports a user's function, `module:function`.

    Unlike a node, it is called with any arguments that a file names, so that it needs a trusted
    scenario even if it is installed. Raises `ScenarioError` if it may not run or is no function.
    """
    if access.is_confined or not access.is_trusted:
        raise ScenarioError(
            f"{where}: runs code of its own ({path}): give --trust, or load_scenario(..., "
            "trust=True) in Python, if it is yours"
        )
    with _also_from(*access.module_folders):
        module = _import(path.partition(":")[0], f"{where}: '{path}' cannot be imported", access)
    name = path.partition(":")[2]
    found = getattr(module, name, None)
    if not callable(found):
        hint = near_miss(name, vars(module)).rstrip(".")
        raise ScenarioError(f"{where}: '{path}' is no function{hint}{_source_of(module, access)}")
    function: Callable[..., Any] = found
    return function


def is_local(module: str | None, access: ScenarioAccess) -> bool:
    """Returns whether a module is found only in the scenario's folder or the working folder.

    Imports nothing. False for None, the module of an unknown name.
    """
    if module is None:
        return False
    top = module.partition(".")[0]
    with _installed_only(access):
        if top in sys.modules or _is_found(top):
            return False
    folders = [str(folder.resolve()) for folder in access.module_folders]
    return PathFinder.find_spec(top, folders) is not None


def _check_allowed(node: str, path: str, where: str, access: ScenarioAccess) -> None:
    if path.startswith(_SHIPPED) or node in access.own_nodes:
        return
    if access.is_confined:
        raise ScenarioError(
            f"{where}: node '{node}' does not ship with Volery: a scenario of a log or of an "
            "upload starts shipped nodes only; name your own file of the scenario to allow its "
            "nodes"
        )
    if path.startswith(("volery.", "volery_benchmarks.")) and not access.is_trusted:
        raise ScenarioError(f"{where}: '{node}' is no node that ships with Volery")


def _is_found(top: str) -> bool:
    try:
        return find_spec(top) is not None
    except (ImportError, ValueError):
        return False


@contextmanager
def _also_from(*folders: Path) -> Iterator[None]:
    """Adds these folders to the import path, after the installed modules."""
    added = [str(folder.resolve()) for folder in folders]
    sys.path.extend(added)
    try:
        yield
    finally:
        for folder in added:
            sys.path.remove(folder)


@contextmanager
def _installed_only(access: ScenarioAccess) -> Iterator[None]:
    """Removes a scenario's folder and the working folder from the import path.

    The latter is on the path of `python -m` and `python -c`.
    """
    local = {folder.resolve() for folder in access.module_folders}
    before = list(sys.path)
    sys.path[:] = [entry for entry in before if Path(entry).resolve() not in local]
    try:
        yield
    finally:
        sys.path[:] = before


def _find_class(path: str, where: str, access: ScenarioAccess) -> type[Any]:
    module_name, class_name = path.split(":")
    provide_ros_imports()
    module = _import(module_name, f"{where}: node '{path}' cannot be imported", access)
    try:
        found = getattr(module, class_name)
    except AttributeError:
        hint = near_miss(class_name, vars(module)).rstrip(".")
        raise ScenarioError(
            f"{where}: module '{module_name}' has no class '{class_name}'{hint}"
            f"{_source_of(module, access)}"
        ) from None
    if not (isinstance(found, type) and issubclass(found, Node)):
        raise ScenarioError(
            f"{where}: '{path}' is no subclass of volery.graph.nodes.node.Node{_hint(found)}"
        )
    return found


def _import(name: str, failure: str, access: ScenarioAccess) -> ModuleType:
    """Imports a module. Raises `ScenarioError` with the failure and its reason."""
    try:
        return importlib.import_module(name)
    except FAILURES as error:
        missing = getattr(error, "name", None) if isinstance(error, ModuleNotFoundError) else None
        if missing and f"{name}.".startswith(f"{missing}."):
            folders = " or ".join(
                dict.fromkeys(str(each.resolve()) for each in access.module_folders)
            )
            raise ScenarioError(
                f"{failure}: no module '{missing}' is installed or lies in {folders}"
            ) from None
        raise _broken(failure, error, advice_for_missing(missing or "")) from error


def _source_of(module: ModuleType, access: ScenarioAccess) -> str:
    """Returns which file a module came from: an installed package may have the name of a file."""
    file = getattr(module, "__file__", None)
    if file is not None and Path(file).parent in {f.resolve() for f in access.module_folders}:
        return ""
    if file is None:
        return "; the name is that of a module of Python or of ROS: rename your file"
    return f"; Python finds {file} under this name: if your file has the same name, rename it"


def _hint(found: Any) -> str:
    bases = [base.__module__ for base in getattr(found, "__mro__", ())]
    if "LifecycleNode" in [base.__name__ for base in getattr(found, "__mro__", ())]:
        return ", but a lifecycle node, which Volery lacks: derive from rclpy.node.Node"
    if "rclpy.node" not in bases:
        return ""
    return (
        ", but of the rclpy of a sourced ROS: run Volery in a shell where none is sourced, or run "
        "the node with ros2 run and open --bridge ros2"
    )


def _broken(what: str, error: BaseException, advice: str = "") -> ScenarioError:
    """Returns an error of the node's code, with its line and the frames of the user's files."""
    kind = "" if isinstance(error, VoleryError) else f"{type(error).__name__}: "
    failure = ScenarioError(f"{what}: {kind}{error}{location_of(error)}{advice}")
    add_frames(failure, error)
    return failure
