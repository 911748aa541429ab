"""Protocols and commands of clients, and the handlers of their messages."""
