"""Reads the docstrings below attributes of classes, which Python itself discards."""

from __future__ import annotations

import ast
import inspect
import sys
from functools import cache
from itertools import pairwise


def attribute_docs(cls: type) -> dict[str, str]:
    """Returns the docstrings of a class's attributes, inherited ones included, by name.

    Classes without source code have none.
    """
    found: dict[str, str] = {}
    for base in reversed(cls.__mro__):
        found |= _docs_of_module(base.__module__).get(base.__qualname__, {})
    return found


@cache
def _docs_of_module(module: str) -> dict[str, dict[str, str]]:
    """Returns the docstrings of all attributes of the classes of a module."""
    try:
        tree = ast.parse(inspect.getsource(sys.modules[module]))
    except (KeyError, OSError, TypeError):
        return {}
    found: dict[str, dict[str, str]] = {}
    _collect(tree, "", found)
    return found


def _collect(
    node: ast.Module | ast.ClassDef, prefix: str, found: dict[str, dict[str, str]]
) -> None:
    for inner in node.body:
        if isinstance(inner, ast.ClassDef):
            name = f"{prefix}{inner.name}"
            found[name] = _docs_of_class(inner)
            _collect(inner, f"{name}.", found)


def _docs_of_class(node: ast.ClassDef) -> dict[str, str]:
    """Returns the docstrings of attributes in a class's body, and of those that `__init__` sets."""
    bodies = [node.body]
    bodies += [
        inner.body
        for inner in node.body
        if isinstance(inner, ast.FunctionDef) and inner.name == "__init__"
    ]
    found = {}
    for body in bodies:
        for attribute, following in pairwise(body):
            name, text = _attribute_name(attribute), _text(following)
            if name and text:
                found[name] = inspect.cleandoc(text)
    return found


def _attribute_name(node: ast.stmt) -> str:
    target: ast.expr | None = None
    if isinstance(node, ast.AnnAssign):
        target = node.target
    elif isinstance(node, ast.Assign) and len(node.targets) == 1:
        target = node.targets[0]
    if isinstance(target, ast.Name):
        return target.id
    return target.attr if isinstance(target, ast.Attribute) else ""


def _text(node: ast.stmt) -> str:
    is_text = isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
    value = node.value.value if is_text else None  # type: ignore[attr-defined]
    return value if isinstance(value, str) else ""
