"""Creates the files of a ROS 1 package with Volery's message types, for catkin or genpy."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path

from volery.graph.codecs.definition_files import DefinitionFile
from volery.graph.codecs.ros1 import Ros1Codec, ros1_codec, ros1_name

GENERATOR = Path(__file__).with_name("ros1_python_generator.py")
"""Program that creates Python modules of such packages; runs alone, with ROS 1's own Python."""
_KINDS = ("msg", "srv")
_BASIC = "builtin_interfaces/"
"""Package whose types are basic types in ROS 1."""
_NAME = re.compile(r"[A-Za-z][\w/]*(?:<=\d+)?(?:\[[^\]]*\])?\s+(?P<name>[A-Za-z]\w*)", re.ASCII)
_MARK = "---"


def package_name(package: str) -> str:
    """Returns the name that a package has in ROS 1."""
    return ros1_name(f"{package}/Any").partition("/")[0]


def needs(files: Sequence[DefinitionFile]) -> list[str]:
    """Returns the other packages that the definitions of one package use, sorted."""
    codec = ros1_codec()
    nested = {
        ros1_name(name).partition("/")[0]
        for file in _known(files)
        for name in codec.nested_types(file.base)
        if not name.startswith(_BASIC)
    }
    return sorted(nested - {package_name(file.package) for file in files})


def contents(package: str, files: Sequence[DefinitionFile], version: str) -> dict[str, str]:
    """Returns the texts of the package's files by their relative paths, without actions."""
    name, others, known = package_name(package), needs(files), _known(files)
    codec = ros1_codec()
    return {
        **{f"{file.kind}/{file.path.name}": definition(file, codec) for file in known},
        "package.xml": _manifest(name, others, version),
        "CMakeLists.txt": _build(name, known, others),
    }


def definition(file: DefinitionFile, codec: Ros1Codec) -> str:
    """Returns a definition in ROS 1's spelling, with the comments on lines of their own.

    If ROS 1 has other fields than the file, returns ROS 1's definition without comments.
    """
    plain = codec.own_definition_text(file.base)
    parts = [_lines_by_name(part) for part in _sections(plain.splitlines())]
    texts = file.path.read_text("utf-8").splitlines()
    written: list[str] = []
    for k, section in enumerate(_sections(texts)):
        left = dict(parts[k])
        for line in section:
            named = _NAME.match(line.strip())
            if named is None:
                written.append(line)
                continue
            text = left.pop(named["name"], None)
            if text is None:
                return plain
            written.append(text)
        if left:
            return plain
        written.append(_MARK)
    return "".join(f"{line}\n" for line in written[:-1])


def _known(files: Sequence[DefinitionFile]) -> list[DefinitionFile]:
    return [file for file in files if file.kind in _KINDS]


def _sections(lines: Sequence[str]) -> Iterator[list[str]]:
    """Yields the lines before, between and after the marks of a service."""
    section: list[str] = []
    for line in lines:
        if line.strip() == _MARK:
            yield section
            section = []
        else:
            section.append(line)
    yield section


def _lines_by_name(lines: Sequence[str]) -> dict[str, str]:
    named = ((_NAME.match(line), line) for line in lines)
    return {found["name"]: line for found, line in named if found is not None}


def _manifest(package: str, others: Sequence[str], version: str) -> str:
    """Returns package.xml, in format 2 (REP 140)."""
    depends = "".join(f"  <depend>{name}</depend>\n" for name in others)
    return f"""<?xml version="1.0"?>
<package format="2">
  <name>{package}</name>
  <version>{version}</version>
  <description>Types of {package} as Volery {version} defines them.</description>
  <maintainer email="nobody@example.org">The Volery developers</maintainer>
  <license>Apache-2.0</license>

  <buildtool_depend>catkin</buildtool_depend>
  <build_depend>message_generation</build_depend>
{depends}  <exec_depend>message_runtime</exec_depend>
</package>
"""


def _build(package: str, files: Sequence[DefinitionFile], others: Sequence[str]) -> str:
    """Returns CMakeLists.txt for catkin."""
    needed = " ".join(others)
    adding = ""
    for kind, command in (("msg", "add_message_files"), ("srv", "add_service_files")):
        names = "".join(f"  {file.path.name}\n" for file in files if file.kind == kind)
        if names:
            adding += f"{command}(FILES\n{names})\n"
    return f"""cmake_minimum_required(VERSION 3.0.2)
project({package})

find_package(catkin REQUIRED COMPONENTS message_generation {needed})
{adding}generate_messages(DEPENDENCIES {needed})
catkin_package(CATKIN_DEPENDS message_runtime {needed})
"""
