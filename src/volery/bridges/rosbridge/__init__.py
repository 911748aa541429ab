"""rosbridge v2 over WebSocket: server, rosapi, client."""
