"""The status topics of nodes: JSON in std_msgs/String, published when it changes."""

from __future__ import annotations

import json
from typing import Any

from volery.graph.messages import String
from volery.graph.nodes.handles import NodePublisher


def publish_status(publisher: NodePublisher, status: dict[str, Any], last: str) -> str:
    """Publishes `status` where its JSON differs from `last`; returns the JSON."""
    text = json.dumps(status)
    if text != last:
        publisher.publish(String(text))
    return text
