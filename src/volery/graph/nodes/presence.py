"""Which nodes in processes of their own take part in a graph.

Each announces itself, when it is ready, by advertising a topic that carries nothing. So it is known
over every connection, and gone when its connection is.
"""

from __future__ import annotations

from volery.graph.graph import Graph

PREFIX = "/volery/nodes"
TYPE = "std_msgs/msg/Empty"


def presence_topic(node: str) -> str:
    """The topic that a node of this full name advertises."""
    return f"{PREFIX}{node}"


def outside_nodes(graph: Graph) -> list[str]:
    """Full names of the nodes that have announced themselves."""
    return [
        topic.name.removeprefix(PREFIX)
        for topic in graph.topics()
        if topic.name.startswith(f"{PREFIX}/") and topic.publishers
    ]
