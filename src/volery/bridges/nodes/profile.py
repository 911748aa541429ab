"""Launch profiles: run the same node in simulation, on the ground and in flight.

A profile is a TOML file that defines where a node runs and how its topics are named there. A
profile never changes what the node does.

    name = "flight_test"
    via = "ros1"
    namespace = "/uav1"
    clock = "wall"

    [remap]
    "laser/horizontal/scan" = "/scan"
    "odom" = "/mavros/local_position/odom"

    [parameters]
    height_m = 3.0

A profile with nodes launches all of them in one process (`volery launch`):

    [[launch]]
    node = "task_manager"
    parameters = { area_m = [0.0, 0.0, 100.0, 100.0] }
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

from volery.scenario.data_files import load_data_file
from volery.scenario.node_names import NODE_PATTERN

Name = Annotated[str, Field(pattern=r"^/?[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*$")]
Namespace = Annotated[str, Field(pattern=r"^(/[A-Za-z_][A-Za-z0-9_]*)*$")]


class Launched(BaseModel):
    """A node that a profile launches."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    node: Annotated[str, Field(pattern=NODE_PATTERN)]
    """Registered name, such as `slam`, or `module:Class`."""
    parameters: dict[str, Any] = {}


class Profile(BaseModel):
    """Options of launched nodes."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    name: str = "default"
    via: str | None = None
    """Graph connection, as in `volery node --via`."""
    namespace: Namespace = ""
    clock: Literal["auto", "simulated", "wall"] = "auto"
    remap: dict[Name, Name] = {}
    """Maps the node's names, relative ones below its namespace, to those of the graph."""
    parameters: dict[str, Any] = {}
    """Parameters of the node that `volery node` starts."""
    launch: tuple[Launched, ...] = ()
    """Nodes that `volery launch` starts."""
    message_packages: tuple[str, ...] = ()
    """Folders of ROS packages with message definitions, relative to the profile."""


def load_profile(path: Path) -> Profile:
    """Reads a profile. Raises `DataFileError` with file, key and allowed values."""
    return load_data_file(path, Profile)


def absolute_names(remap: dict[str, str], namespace: str) -> dict[str, str]:
    """Returns `remap` with absolute names, for `graph.nodes.node.Context`."""

    def resolve(name: str) -> str:
        return name if name.startswith("/") else f"{namespace}/{name}"

    return {resolve(mine): resolve(theirs) for mine, theirs in remap.items()}
