"""Writes the message types that come with Volery as ROS 2 packages, which colcon builds.

With them built and sourced, ROS 2's own tools know those types.
"""

from __future__ import annotations

import shutil
from importlib.metadata import version
from pathlib import Path

from volery.core.errors import GraphError
from volery.graph.definition_files import (
    DefinitionFile,
    find_definition_files,
    read_definition_file,
)

OWN = "volery_interfaces"
"""The package that nobody else has."""
DEFINITIONS = Path(__file__).parent / "definitions"
_ACTIONS_NEED = "action_msgs"
"""What rosidl adds to packages with actions."""


def packages() -> list[str]:
    """Packages of which definitions come with Volery."""
    return sorted(folder.name for folder in DEFINITIONS.iterdir() if folder.is_dir())


def needs(package: str) -> list[str]:
    """Other packages that a package's definitions name, sorted. `GraphError` where it is none."""
    files = _files(package)
    nested = {
        name.partition("/")[0]
        for file in files
        for definition in read_definition_file(file)
        for name, _line in definition.nested
    }
    if any(file.kind == "action" for file in files):
        nested.add(_ACTIONS_NEED)
    return sorted(nested - {package})


def write_package(package: str, folder: Path, *, overwrite: bool = False) -> Path:
    """Write a package into a new folder of its name below `folder`, and return that.

    `GraphError` where there is no such package, or where its folder exists and holds anything that
    is not to be replaced.
    """
    files, target = _files(package), folder / package
    if target.exists() and not overwrite:
        raise GraphError(f"{target}: exists already; --overwrite replaces it")
    if target.exists() and not (target / "package.xml").is_file():
        raise GraphError(f"{target}: is no package that could be replaced")
    try:
        if target.exists():
            shutil.rmtree(target)
        for file in files:
            place = target / file.kind
            place.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(file.path, place / file.path.name)
        others = needs(package)
        (target / "package.xml").write_text(_manifest(package, others), encoding="utf-8")
        (target / "CMakeLists.txt").write_text(_build(package, files, others), encoding="utf-8")
    except OSError as error:
        raise GraphError(f"{target}: cannot be written: {error.strerror}") from None
    return target


def _files(package: str) -> list[DefinitionFile]:
    if package not in packages():
        raise GraphError(
            f"no package '{package}' comes with Volery; there are {', '.join(packages())}"
        )
    return find_definition_files(DEFINITIONS / package)


def _manifest(package: str, others: list[str]) -> str:
    """package.xml, in format 3 (REP 149)."""
    depends = "".join(f"  <depend>{name}</depend>\n" for name in others)
    return f"""<?xml version="1.0"?>
<package format="3">
  <name>{package}</name>
  <version>{version("volery")}</version>
  <description>Types of {package} as Volery {version("volery")} defines them.</description>
  <maintainer email="nobody@example.org">The Volery developers</maintainer>
  <license>Apache-2.0</license>

  <buildtool_depend>ament_cmake</buildtool_depend>
  <buildtool_depend>rosidl_default_generators</buildtool_depend>
{depends}  <exec_depend>rosidl_default_runtime</exec_depend>
  <member_of_group>rosidl_interface_packages</member_of_group>

  <export>
    <build_type>ament_cmake</build_type>
  </export>
</package>
"""


def _build(package: str, files: list[DefinitionFile], others: list[str]) -> str:
    """CMakeLists.txt, as rosidl wants it."""
    found = "".join(f"find_package({name} REQUIRED)\n" for name in others)
    listed = "".join(f'  "{file.kind}/{file.path.name}"\n' for file in files)
    needed = f"  DEPENDENCIES {' '.join(others)}\n" if others else ""
    return f"""cmake_minimum_required(VERSION 3.8)
project({package})

find_package(ament_cmake REQUIRED)
find_package(rosidl_default_generators REQUIRED)
{found}
rosidl_generate_interfaces(${{PROJECT_NAME}}
{listed}{needed})

ament_export_dependencies(rosidl_default_runtime)
ament_package()
"""
