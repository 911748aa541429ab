"""`volery launch`: runs the nodes of a profile together in one process."""

from __future__ import annotations

import os
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from volery.cli.connections import DEFAULT_VIA, ConnectionMonitor, await_link, join_late
from volery.cli.terminal import echo_line
from volery.cli.trust import may_run_local_nodes
from volery.core.errors import BridgeError
from volery.scenario.access import ScenarioAccess

if TYPE_CHECKING:
    from volery.bridges.nodes.host import NodeHost
    from volery.bridges.nodes.profile import Profile
    from volery.graph.nodes.node import Node


def launch_profile(
    path: Path,
    *,
    via: str | None,
    namespace: str | None,
    lock_step_s: float | None,
    trust: bool = False,
) -> None:
    """Runs the nodes of a profile until Ctrl-C or until one fails; None: as in the profile.

    trust: whether modules in the profile's folder may run without a question. Raises `BridgeError`
    if the profile names no nodes, `ScenarioError` for nodes that may not run.
    """
    from volery.bridges.nodes.deferred_connection import DeferredConnection
    from volery.bridges.nodes.host import NodeHost
    from volery.bridges.nodes.profile import load_profile

    profile = load_profile(path)
    if not profile.launch:
        raise BridgeError(f"{path}: has no [[launch]]; `volery node` starts one node")
    nodes = [entry.node for entry in profile.launch]
    access = ScenarioAccess(path.parent, is_trusted=trust)
    if not trust:
        access = replace(access, is_trusted=may_run_local_nodes(path, nodes, access))
    if namespace is not None:
        profile = profile.model_copy(update={"namespace": namespace})
    url = via or profile.via or os.environ.get("VOLERY_VIA") or DEFAULT_VIA
    with closing(DeferredConnection(profile.name, lambda: await_link(url, profile.name))) as late:
        host = NodeHost(late, clock=profile.clock)
        started = start_profile(profile, host, access)
        try:
            link = join_late(late, host)
            if lock_step_s is not None:
                host.join_lock_step(profile.name, lock_step_s)
            for node in started:
                host.announce(node.full_name)
            names = ", ".join(node.get_name() for node in started)
            echo_line(f"{names} run on {url}; Ctrl-C ends them", err=True)
            host.spin(ConnectionMonitor(link, url))
        finally:
            for node in started:
                node.destroy_node()


def start_profile(
    profile: Profile, host: NodeHost, access: ScenarioAccess | None = None
) -> list[Node]:
    """Starts the nodes of a profile on a host, in the profile's order.

    access: which modules may run; None: the access of a scenario made by a program.
    """
    from volery.bridges.nodes.profile import absolute_names
    from volery.runtime.construction.node_loading import start_node
    from volery.scenario.schema import NodeEntry

    names = absolute_names(profile.remap, profile.namespace)
    return [
        start_node(
            NodeEntry(node=entry.node, parameters=entry.parameters),
            host.context(names),
            profile.namespace,
            f"{profile.name}: launch[{k}]",
            access or ScenarioAccess(),
        )
        for k, entry in enumerate(profile.launch)
    ]
