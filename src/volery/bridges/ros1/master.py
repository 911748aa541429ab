"""Queries a ROS 1 master, with a timeout."""

from __future__ import annotations

import http.client
import xmlrpc.client
from typing import Any
from urllib.parse import urlsplit

from volery.core.errors import BridgeError

_TIMEOUT_S = 3.0


class _Transport(xmlrpc.client.Transport):
    def make_connection(self, host: Any) -> http.client.HTTPConnection:
        connection = super().make_connection(host)
        connection.timeout = _TIMEOUT_S
        return connection


class Ros1Master:
    """The master at `uri`, queried in the name of one node. Safe to use from several threads."""

    def __init__(self, uri: str, node_name: str) -> None:
        parts = urlsplit(uri)
        try:
            known = parts.scheme == "http" and parts.hostname and parts.port
        except ValueError:
            known = None
        if not known:
            raise BridgeError(f"'{uri}' is not the address of a ROS master; use http://HOST:11311")
        self.uri = uri
        self.host = str(parts.hostname)
        self._node_name = node_name

    def ask(self, method: str, *arguments: Any) -> Any:
        """Returns the value of the master's `method`.

        Raises
        ------
        OSError
            The master does not answer.
        BridgeError
            The master reports an error.

        """
        with xmlrpc.client.ServerProxy(self.uri, transport=_Transport()) as proxy:
            try:
                code, text, value = getattr(proxy, method)(self._node_name, *arguments)
            except (xmlrpc.client.Error, http.client.HTTPException, ValueError, TypeError) as error:
                raise BridgeError(f"{self.uri} is not a ROS master: {error}") from None
        if code != 1:
            raise BridgeError(f"ROS master: {method}: {text}")
        return value

    def knows_service(self, service: str) -> bool:
        """Returns whether a service has a server.

        Raises `OSError` if the master does not answer.
        """
        try:
            return bool(self.ask("lookupService", service))
        except BridgeError:
            return False
