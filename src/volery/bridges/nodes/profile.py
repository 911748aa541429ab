"""Launch profiles: the same node in simulation, on the ground and in flight.

A profile is a TOML file that says where a node runs and what its topics are called there. It never
changes what the node does.

    name = "flight_test"
    via = "ros1"
    namespace = "/uav1"
    clock = "wall"

    [remap]
    "laser/horizontal/scan" = "/scan"
    "odom" = "/mavros/local_position/odom"

    [parameters]
    height_m = 3.0

One that names nodes launches all of them in one process (`volery launch`):

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
    """A registered name, such as `slam`, or `module:Class`."""
    parameters: dict[str, Any] = {}


class Profile(BaseModel):
    """How nodes are launched."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    name: str = "default"
    via: str | None = None
    """Way into the graph, as `volery node --via` takes it."""
    namespace: Namespace = ""
    clock: Literal["auto", "simulated", "wall"] = "auto"
    remap: dict[Name, Name] = {}
    """The node's names, relative ones below its namespace, to those of the graph."""
    parameters: dict[str, Any] = {}
    """Of the node that `volery node` starts."""
    launch: tuple[Launched, ...] = ()
    """What `volery launch` starts."""
    message_packages: tuple[str, ...] = ()
    """Folders of ROS packages with message definitions, beside the profile."""


def load_profile(path: Path) -> Profile:
    """Read a profile. Raises `DataFileError` naming file, key and what is allowed."""
    return load_data_file(path, Profile)


def absolute_names(remap: dict[str, str], namespace: str) -> dict[str, str]:
    """`remap` with relative names made absolute, as `graph.nodes.node.Context` takes it."""

    def resolve(name: str) -> str:
        return name if name.startswith("/") else f"{namespace}/{name}"

    return {resolve(mine): resolve(theirs) for mine, theirs in remap.items()}
