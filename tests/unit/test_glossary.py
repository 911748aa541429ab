"""Names of modules, classes and options keep to docs/glossary.md."""

from __future__ import annotations

import ast
import functools
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
import typer

from volery.cli.app import app

_ROOT = Path(__file__).parents[2]
_SOURCES = (_ROOT / "src" / "volery", _ROOT / "benchmarks" / "volery_benchmarks")


def banned_words() -> set[str]:
    """The words of the last column of the glossary's tables."""
    words: set[str] = set()
    for line in (_ROOT / "docs" / "glossary.md").read_text().splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if line.startswith("| ") and len(cells) == 3 and cells[2] != "not":
            words |= {word.strip() for word in cells[2].split(",")}
    return words - {""}


BANNED = banned_words()
BANNED_IN_ALL_NAMES = {
    *("anew", "carrot", "crew", "door", "doors", "doubt", "farthest", "guess", "guesses", "hear"),
    *("heard", "hears", "keeper", "lobby", "mailbox", "party", "patience", "picture", "pictures"),
    *("pilot", "pipe", "seat", "tell", "telling", "tells", "told", "thinker", "watcher"),
    *("bite", "farewell", "outfit", "said", "say", "stranger", "who"),
}
"""Words that names of functions, parameters and attributes do not contain either."""
UNCHECKED = ("bridges/logs/disk_file.py",)  # `tell` of Python's files
"""Files and folders whose functions, parameters and attributes may contain them."""

_NAMED = (ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef, ast.arg, ast.Attribute)


def parts_of(name: str) -> list[str]:
    """The words of a name in snake_case, kebab-case or CamelCase, in lower case."""
    return [word.lower() for word in re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z0-9]+", name)]


@functools.cache
def nodes_of(path: Path) -> list[ast.AST]:
    """The named nodes of a file: parsing and walking take most of the time of these tests."""
    return [node for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, _NAMED)]


def names() -> Iterator[tuple[str, str]]:
    """(name, where it is) of all modules and classes."""
    paths = [(source, path) for source in _SOURCES for path in sorted(source.rglob("*.py"))]
    for source, path in paths:
        where = path.relative_to(source)
        yield from ((part, str(where)) for part in where.with_suffix("").parts)
        for node in nodes_of(path):
            if isinstance(node, ast.ClassDef):
                yield node.name, f"{where}: class {node.name}"


def inner_names() -> Iterator[tuple[str, str]]:
    """(name, where it is) of functions, methods, their parameters, and attributes that are set."""
    for path in sorted(_SOURCES[0].rglob("*.py")):
        where = path.relative_to(_SOURCES[0]).as_posix()
        if where.startswith(UNCHECKED):
            continue
        for node in nodes_of(path):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                yield node.name, f"{where}:{node.lineno} {node.name}"
            elif isinstance(node, ast.arg):
                yield node.arg, f"{where}:{node.lineno} {node.arg}"
            elif isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store):
                yield node.attr, f"{where}:{node.lineno} {node.attr}"


def options() -> Iterator[tuple[str, str]]:
    """(option, command) of the whole command line."""

    def of(command: object, path: str) -> Iterator[tuple[str, str]]:
        for name, inner in getattr(command, "commands", {}).items():
            yield from of(inner, f"{path} {name}")
        for parameter in getattr(command, "params", []):
            for option in parameter.opts + parameter.secondary_opts:
                if option.startswith("--"):
                    yield option.removeprefix("--"), path

    yield from of(typer.main.get_command(app), "volery")


def test_the_glossary_bans_words() -> None:
    assert {"door", "crew", "lobby", "told", "thing", "pilot"} <= BANNED
    assert len(BANNED) > 60


def test_modules_and_classes_use_the_words_of_the_glossary() -> None:
    known = list(names())
    assert {"bridge_host", "BridgeHost", "SlamHealth"} <= {name for name, _ in known}
    found = [where for name, where in known if BANNED & set(parts_of(name))]
    assert found == []


def test_functions_parameters_and_attributes_use_the_words_of_the_glossary() -> None:
    known = list(inner_names())
    checked = {name for name, _ in known}
    assert {"create_service", "has_subscribers", "queue", "_timeout_policy"} <= checked
    found = [where for name, where in known if BANNED_IN_ALL_NAMES & set(parts_of(name))]
    assert found == []


def test_options_use_the_words_of_the_glossary() -> None:
    known = set(options())
    assert {("bridge", "volery run"), ("via", "volery topic echo")} <= known
    found = [(path, option) for option, path in known if BANNED & set(parts_of(option))]
    assert found == []


@pytest.mark.parametrize("name", ["DoorBridge", "the_lobby", "--drop-crew"])
def test_a_banned_word_is_found_in_any_spelling(name: str) -> None:
    assert BANNED & set(parts_of(name))
