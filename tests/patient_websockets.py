"""A plain WebSocket client that waits for a busy machine; by itself it gives up after 10 s."""

from __future__ import annotations

from functools import partial

import websockets.sync.client

connect = partial(websockets.sync.client.connect, open_timeout=60.0)
