"""The communication server: a router without sockets, and its TCP server."""
