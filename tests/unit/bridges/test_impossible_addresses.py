"""Clients of invalid addresses, and of addresses without a server."""

from __future__ import annotations

import pytest

from volery.bridges.rosbridge.client import RosbridgeClient
from volery.core.errors import BridgeError, UnreachableError


@pytest.mark.parametrize("url", ["ws://", "ws://localhost:x", "ws://localhost:99999", "ws://:1"])
def test_an_invalid_address_is_an_error_at_once(url: str) -> None:
    with pytest.raises(BridgeError, match=f"'{url}' is not a rosbridge address"):
        RosbridgeClient(url, connect_timeout_s=60.0)


def test_rosbridge() -> None:
    with pytest.raises(UnreachableError, match="no rosbridge server"):
        RosbridgeClient("ws://a..b:9090", connect_timeout_s=0.5)


def test_an_error_says_why_no_server_answers() -> None:
    with pytest.raises(UnreachableError) as caught:
        RosbridgeClient("ws://127.0.0.1:1", connect_timeout_s=1.0)
    assert str(caught.value).endswith("127.0.0.1:1: Connection refused")
