"""`volery node`: runs a node in its own process, on the graph of a simulation or a real vehicle."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from volery.cli.connections import (
    DEFAULT_VIA,
    ROS2_SCHEMES,
    ConnectionMonitor,
    await_link,
    join_late,
)
from volery.cli.error_reporting import warn
from volery.cli.graph_queries import topic_types
from volery.cli.terminal import echo_line
from volery.cli.yaml_codec import from_yaml
from volery.core.errors import BridgeError, VoleryError

if TYPE_CHECKING:
    from volery.graph.connection import GraphConnection


@dataclass(frozen=True)
class NodeOptions:
    """Holds the command line's options; None: as in the profile."""

    node: str
    via: str | None
    namespace: str | None
    profile: Path | None
    parameters: Sequence[str] = ()
    lock_step_s: float | None = None
    messages: Sequence[str] = ()
    """Folders of message definitions."""


def run_node(options: NodeOptions) -> None:
    """Runs a node until Ctrl-C or until it fails."""
    from pydantic import ValidationError

    from volery.bridges.nodes.deferred_connection import DeferredConnection
    from volery.bridges.nodes.host import NodeHost
    from volery.bridges.nodes.profile import Profile, absolute_names, load_profile
    from volery.graph.messages import add_definitions
    from volery.runtime.construction.node_loading import start_node
    from volery.runtime.warmup.parallel_compilation import compile_all
    from volery.scenario.access import ScenarioAccess
    from volery.scenario.schema import NodeEntry

    profile = Profile() if options.profile is None else load_profile(options.profile)
    for name in (*options.messages, *profile.message_packages):
        add_definitions(_folder_of(name, options.profile))
    namespace = profile.namespace if options.namespace is None else options.namespace
    parameters = {**profile.parameters, **_parameters(options.parameters)}
    try:
        entry = NodeEntry(node=options.node, parameters=parameters)
    except ValidationError:
        raise BridgeError(
            f"'{options.node}' is not a node; use a name of `volery list --nodes`, or module:Class"
        ) from None
    name = options.node.rpartition(":")[2]
    via = options.via or profile.via or os.environ.get("VOLERY_VIA") or DEFAULT_VIA
    if options.lock_step_s is not None and via.partition("://")[0] in ROS2_SCHEMES:
        raise BridgeError("--lock-step: ROS 2 keeps no order between topics; use rosbridge")
    if options.lock_step_s is not None and not 0.0 < options.lock_step_s < math.inf:
        raise BridgeError(f"--lock-step: a period in s above 0, not {options.lock_step_s:g}")
    folder = options.profile.parent if options.profile else None
    access = ScenarioAccess(folder)  # the command line names the node itself
    with closing(DeferredConnection(name, lambda: await_link(via, name))) as late:
        host = NodeHost(late, clock=profile.clock)
        context = host.context(absolute_names(profile.remap, namespace))
        node = start_node(entry, context, namespace, "volery node", access)
        try:
            # before the graph, or a clock in lock step, waits for the node
            compile_all(node.warmup_tasks())
            link = join_late(late, host)
            if options.lock_step_s is not None:
                host.join_lock_step(node.get_name(), options.lock_step_s)
            host.announce(node.full_name)
            echo_line(f"{node.get_name()} runs on {via}; Ctrl-C ends it", err=True)
            _check_namespace(link, namespace)
            host.spin(ConnectionMonitor(link, via))
        finally:
            node.destroy_node()


def _check_namespace(link: GraphConnection, namespace: str) -> None:
    """Warns if the graph lists its topics and has none of the node's UAV."""
    uav = namespace.strip("/")
    try:
        topics = topic_types(link)
    except VoleryError:  # ROS 1 has no rosapi unless it is started
        return
    names = sorted({topic.split("/")[1] for topic in topics if topic.count("/") > 1})
    if uav and uav not in names and topics:
        uavs = [name for name in names if f"/{name}/odom" in topics]
        warn(f"the graph has no topic below /{uav}; its UAVs: {', '.join(uavs) or 'none'}")


def _folder_of(name: str, profile: Path | None) -> Path:
    """Returns a folder relative to the profile, else relative to the working folder."""
    nested = Path(name) if profile is None else profile.parent / name
    return nested if nested.is_dir() else Path(name)


def _parameters(words: Sequence[str]) -> dict[str, Any]:
    """Parses `NAME:=VALUE` or `NAME=VALUE`, the value as YAML."""
    found: dict[str, Any] = {}
    for word in words:
        name, equals, value = word.partition("=")
        if not equals:
            raise BridgeError(f"--param: expects NAME=VALUE, not '{word}'")
        found[name.rstrip(":")] = from_yaml(value)
    return found
