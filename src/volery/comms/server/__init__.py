"""The communication server: a router without sockets, and TCP around it."""
