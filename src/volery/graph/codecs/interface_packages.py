"""Writes Volery's message types as ROS 2 or ROS 1 packages.

After building and sourcing them, ROS's own tools know the types. colcon builds the ROS 2 packages,
catkin the ROS 1 packages; without catkin, `generate_python.py` next to them creates their Python
modules.
"""

from __future__ import annotations

import shutil
from importlib.metadata import version
from pathlib import Path

from volery.core.errors import GraphError
from volery.core.whole_files import write_whole
from volery.graph.codecs import ros1_package
from volery.graph.codecs.definition_files import (
    DefinitionFile,
    find_definition_files,
    read_definition_file,
)

OWN = "volery_interfaces"
"""The package that only Volery provides."""
DEFINITIONS = Path(__file__).parents[1] / "definitions"
_ROS2_ALONE = ("action_msgs", "rcl_interfaces")
_ACTIONS_NEED = "action_msgs"
"""Dependency that rosidl adds to packages with actions."""


def packages() -> list[str]:
    """Returns the packages whose definitions come with Volery."""
    return sorted(folder.name for folder in DEFINITIONS.iterdir() if folder.is_dir())


def needs(package: str, *, ros1: bool = False) -> list[str]:
    """Returns the other packages that a package's definitions use, sorted.

    ros1: the packages' names in ROS 1. Raises `GraphError` if the package does not exist.
    """
    files = _files(package)
    if ros1:
        return ros1_package.needs(files)
    nested = {
        name.partition("/")[0]
        for file in files
        for definition in read_definition_file(file)
        for name, _line in definition.nested
    }
    if any(file.kind == "action" for file in files):
        nested.add(_ACTIONS_NEED)
    return sorted(nested - {package})


def write_package(
    package: str, folder: Path, *, overwrite: bool = False, ros1: bool = False
) -> Path:
    """Writes a package into a new folder of its name below `folder`; returns the new folder.

    `folder` must exist. overwrite: replaces an older package. ros1: writes a ROS 1 package: without
    actions, in the spelling of ROS 1.

    Raises `GraphError` if the package does not exist, its folder exists and must not be replaced,
    or the folder cannot be written.
    """
    contents = _ros1_contents(package) if ros1 else _ros2_contents(package)
    target = folder / (ros1_package.package_name(package) if ros1 else package)
    if target.exists() and not overwrite:
        raise GraphError(f"{target}: already exists; --overwrite replaces it")
    if target.exists() and not (target / "package.xml").is_file():
        raise GraphError(f"{target}: is not a package, and is not replaced; choose another folder")
    try:
        if target.exists():
            shutil.rmtree(target)
        for name, text in contents.items():
            (target / name).parent.mkdir(parents=True, exist_ok=True)
            (target / name).write_text(text, encoding="utf-8")
    except OSError as error:
        raise GraphError(f"{target}: cannot be written: {error.strerror}") from None
    return target


def write_generator(folder: Path) -> Path:
    """Writes the program that creates Python modules of the ROS 1 packages in `folder`.

    Returns its path. Raises `GraphError` if the program cannot be written.
    """
    target = folder / "generate_python.py"
    try:
        write_whole(target, ros1_package.GENERATOR.read_bytes())
    except OSError as error:
        raise GraphError(f"{target}: cannot be written: {error.strerror}") from None
    return target


def _ros2_contents(package: str) -> dict[str, str]:
    """Returns the texts of a ROS 2 package's files by their relative paths."""
    files, others = _files(package), needs(package)
    return {
        **{f"{file.kind}/{file.path.name}": file.path.read_text("utf-8") for file in files},
        "package.xml": _manifest(package, others),
        "CMakeLists.txt": _build(package, files, others),
    }


def _ros1_contents(package: str) -> dict[str, str]:
    if package in _ROS2_ALONE:
        raise GraphError(f"{package} exists only in ROS 2: omit --ros1")
    return ros1_package.contents(package, _files(package), version("volery"))


def _files(package: str) -> list[DefinitionFile]:
    if package not in packages():
        raise GraphError(
            f"no package '{package}' comes with Volery; known packages: {', '.join(packages())}"
        )
    return find_definition_files(DEFINITIONS / package)


def _manifest(package: str, others: list[str]) -> str:
    """Returns package.xml, in format 3 (REP 149)."""
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
    """Returns CMakeLists.txt for rosidl."""
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
