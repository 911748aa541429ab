"""Modules import each other in one direction only, in functions and for types as well."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

_SOURCE = Path(__file__).parents[2] / "src"

ALLOWED = {
    "volery.engine.stages": "the stages are the methods of the engine, one function each",
}
"""Reasons for the circles through a module."""


def sources() -> dict[str, Path]:
    """The files of all modules and packages, by dotted name."""
    found = {}
    for path in sorted((_SOURCE / "volery").rglob("*.py")):
        parts = path.relative_to(_SOURCE).with_suffix("").parts
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


def imports_of(path: Path) -> Iterator[str]:
    """The names that a file imports anywhere."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert not node.level, f"{path}: a relative import"
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def import_graph() -> dict[str, set[str]]:
    """The modules of volery that each module imports; parent packages count only if named."""
    known = sources()

    def module_of(name: str) -> str:
        while name and name not in known:
            name = name.rpartition(".")[0]
        return name

    return {
        module: {module_of(name) for name in imports_of(path)} - {module, ""}
        for module, path in known.items()
    }


def reachable(graph: dict[str, set[str]], start: str) -> set[str]:
    """The modules that a module imports, directly or through others."""
    found: set[str] = set()
    pending = [start]
    while pending:
        following = graph[pending.pop()] - found
        found |= following
        pending += following
    return found


def circles() -> list[list[str]]:
    """The groups of modules that reach each other."""
    graph = import_graph()
    reached = {module: reachable(graph, module) for module in graph}
    groups = {
        tuple(sorted(other for other in reached[module] if module in reached[other]))
        for module in graph
        if module in reached[module]
    }
    return sorted(map(list, groups), key=len)


def test_no_module_imports_itself_through_others() -> None:
    """Move what both need into a module of its own, or pass it to the constructor."""
    found = [group for group in circles() if not ALLOWED.keys() & set(group)]
    assert not found, "\n\n".join("\n".join(group) for group in found)


def test_allowed_circles_exist() -> None:
    assert ALLOWED.keys() <= {module for group in circles() for module in group}
