"""Writes the reference of message, service and action types from their definitions."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from reference_links import DEFINITIONS, anchor

from volery.graph.typestore import typestore

_HEAD = """\
# Messages

Volery has the message types of ROS 2 Jazzy's common interfaces and those below, defined in
`src/volery/graph/definitions`. [ROS 2](../ros2.md) describes how to add your own. `volery
interfaces` writes them as ROS packages.
"""
_FORMS = {"msg": "Messages", "srv": "Services", "action": "Actions"}
_FIRST = ("volery_interfaces", "simulation_interfaces")


def page() -> str:
    """Returns the page."""
    return "\n".join(_parts())


def _parts() -> Iterator[str]:
    yield _HEAD
    folders = sorted(path for path in DEFINITIONS.iterdir() if path.is_dir())
    for package in sorted(folders, key=_order):
        yield f"## {package.name}\n"
        for form, title in _FORMS.items():
            for file in sorted((package / form).glob(f"*.{form}")):
                yield from _definition(file, title)
    yield "## Types of ROS 2\n"
    yield "Their definitions are those of the ROS 2 Jazzy packages.\n"
    yield _standard_types()


def _order(package: Path) -> tuple[int, str]:
    first = _FIRST.index(package.name) if package.name in _FIRST else len(_FIRST)
    return first, package.name


def _definition(file: Path, title: str) -> Iterator[str]:
    form, package = file.parent.name, file.parents[1].name
    name = f"{package}/{form}/{file.stem}"
    yield f"### {file.stem} {{ #{anchor(name)} }}\n"
    yield f"`{name}` ({title[:-1].lower()})\n"
    yield f"```\n{file.read_text(encoding='utf-8').rstrip()}\n```\n"


def _standard_types() -> str:
    own = {path.name for path in DEFINITIONS.iterdir()}
    packages: dict[str, list[str]] = {}
    for name in typestore().names():
        package, form, kind = name.split("/")
        if form == "msg" and package not in own:
            packages.setdefault(package, []).append(kind)
    rows = [
        f"| `{package}` | {', '.join(f'`{kind}`' for kind in sorted(kinds))} |"
        for package, kinds in sorted(packages.items())
    ]
    return "\n".join(["| package | messages |", "|---|---|", *rows]) + "\n"


if __name__ == "__main__":
    print(page(), end="")
