"""What other participants of a ROS 2 graph over zenoh send beside messages."""

from __future__ import annotations

from volery.bridges.ros2.middleware import Profile, ServiceSpec, TopicSpec
from volery.bridges.ros2.names import NodeName
from volery.bridges.ros2.zenoh.names import (
    CLIENT,
    PUBLISHER,
    Attachment,
    node_token,
    read_token,
    service_token,
    topic_token,
)

_NODE = NodeName("/uav1", "gap")
_SPEC = TopicSpec(_NODE, "/uav1/scan", "sensor_msgs/msg/LaserScan", Profile(False, True, 5))
_SERVICE = ServiceSpec(_NODE, "/uav1/land", "std_srvs/srv/Trigger")
_TOKENS = tuple(
    token.encode()
    for token in (
        node_token(7, "ab12", 0, _NODE),
        topic_token(7, "ab12", (0, 1), PUBLISHER, _SPEC),
        service_token(7, "ab12", (0, 2), CLIENT, _SERVICE),
        topic_token(7, "ab12", (0, 1), PUBLISHER, _SPEC).rpartition("/")[0] + "/::,10:,:,:,,",
    )
)
_ATTACHMENTS = (Attachment(1, 2, bytes(16)).encode(), Attachment(-1, 2**62, b"\xff" * 16).encode())


def tokens(mutator):
    """Liveliness tokens: what is read is whole."""
    found = read_token(mutator.bytes(_TOKENS).decode(errors="replace"))
    if found is not None:
        assert found.msgtype.count("/") == 2
        assert isinstance(found.profile.depth, int)
    return 1


def attachments(mutator):
    """Attachments: what is read is written the same."""
    data = mutator.bytes(_ATTACHMENTS)
    found = Attachment.decode(data)
    assert found is None or found.encode() == data
    return 1
