"""Lists the nodes in processes of their own that have joined a graph.

Each node announces itself, when it is ready, by advertising a topic without messages. So every
connection can list the nodes, and a node disappears with its connection.
"""

from __future__ import annotations

from volery.graph.graph import Graph

PREFIX = "/volery/nodes"
TYPE = "std_msgs/msg/Empty"


def presence_topic(node: str) -> str:
    """Returns the topic that a node of this full name advertises."""
    return f"{PREFIX}{node}"


def outside_nodes(graph: Graph) -> list[str]:
    """Returns the full names of the announced nodes."""
    return [
        topic.name.removeprefix(PREFIX)
        for topic in graph.topics()
        if topic.name.startswith(f"{PREFIX}/") and topic.publishers
    ]
