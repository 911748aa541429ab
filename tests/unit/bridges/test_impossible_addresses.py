"""Clients of addresses that cannot be: told of as those where nobody answers."""

from __future__ import annotations

import pytest

from volery.bridges.ros_tcp.client import RosTcpClient
from volery.bridges.rosbridge.client import RosbridgeClient
from volery.core.errors import BridgeError


@pytest.mark.parametrize("url", ["ws://a..b:9090", "ws://localhost:x", "ws://localhost:99999"])
def test_rosbridge(url: str) -> None:
    with pytest.raises(BridgeError, match="nobody speaks rosbridge"):
        RosbridgeClient(url, connect_timeout_s=0.5)


def test_ros_tcp() -> None:
    with pytest.raises(BridgeError, match="nobody speaks ROS-TCP"):
        RosTcpClient("a..b", connect_timeout_s=0.5)
