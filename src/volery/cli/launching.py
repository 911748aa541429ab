"""`volery launch`: the nodes of a profile together in a process of their own."""

from __future__ import annotations

import os
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from volery.cli.links import DEFAULT_VIA, LinkTold, await_link, join_late
from volery.core.errors import BridgeError

if TYPE_CHECKING:
    from volery.bridges.nodes.host import NodeHost
    from volery.bridges.nodes.profile import Profile
    from volery.graph.node import Node


def launch_profile(
    path: Path, *, via: str | None, namespace: str | None, lock_step_s: float | None
) -> None:
    """Run the nodes of a profile until Ctrl-C, or until one fails; None leaves it to the profile.

    `BridgeError` where it names no nodes.
    """
    from volery.bridges.nodes.host import NodeHost
    from volery.bridges.nodes.late_link import LateLink
    from volery.bridges.nodes.profile import load_profile

    profile = load_profile(path)
    if not profile.launch:
        raise BridgeError(f"{path}: there is no [[launch]] in it; `volery node` starts one node")
    if namespace is not None:
        profile = profile.model_copy(update={"namespace": namespace})
    way = via or profile.via or os.environ.get("VOLERY_VIA") or DEFAULT_VIA
    with closing(LateLink(profile.name, lambda: await_link(way, profile.name))) as late:
        host = NodeHost(late, clock=profile.clock)
        nodes = start_profile(profile, host, path.parent)
        try:
            link = join_late(late, host)
            if lock_step_s is not None:
                host.join_lock_step(profile.name, lock_step_s)
            names = ", ".join(node.get_name() for node in nodes)
            typer.echo(f"{names} run on {way}; Ctrl-C ends them", err=True)
            host.spin(LinkTold(link, way))
        finally:
            for node in nodes:
                node.destroy_node()


def start_profile(profile: Profile, host: NodeHost, folder: Path | None = None) -> list[Node]:
    """Start the nodes of a profile on a host, in its order."""
    from volery.bridges.nodes.profile import absolute_names
    from volery.runtime.node_loading import start_node
    from volery.scenario.schema import NodeEntry

    names = absolute_names(profile.remap, profile.namespace)
    return [
        start_node(
            NodeEntry(node=entry.node, parameters=entry.parameters),
            host.context(names),
            profile.namespace,
            f"{profile.name}: launch[{k}]",
            folder,
        )
        for k, entry in enumerate(profile.launch)
    ]
