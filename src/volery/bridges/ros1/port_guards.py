"""Limits the cost of clients at the ports that rospy opens: TCPROS and XML-RPC.

rospy waits for headers without end in the thread that accepts connections, reads bodies of any
size, has a thread for each XML-RPC connection, and ends its server when file descriptors run out.
Subclasses replace its classes before a node starts. They also refuse requests of web pages.
"""

from __future__ import annotations

import importlib
import socket
import socketserver
from collections.abc import Mapping
from http import HTTPStatus
from typing import Any

from volery.bridges.ros1.connection_headers import HeaderServer
from volery.core.listener import open_listener

MAX_CALL_BYTES = 256 << 10
"""Largest XML-RPC request. The largest of ROS, publisherUpdate, has 50 bytes per publisher."""
CALL_S = 20.0
"""Timeout of silent XML-RPC connections; clients of ROS reconnect by themselves."""
MAX_CALLERS = 128
"""Largest number of XML-RPC connections, each with a thread; beyond, the oldest is closed."""
MAX_MESSAGE_BYTES = 64 << 20
"""Largest message or service request that a ROS 1 node sends."""


def guard_ports() -> None:
    """Applies the limits to servers that rospy opens from now on; a second call does nothing."""
    tcpros: Any = importlib.import_module("rospy.impl.tcpros_base")
    xmlrpc: Any = importlib.import_module("rosgraph.xmlrpc")
    if getattr(tcpros.TCPServer, "is_guarded", False):
        return
    network: Any = importlib.import_module("rosgraph.network")
    tcpros.TCPServer = _tcpros_server(tcpros.TCPServer, network)
    service: Any = importlib.import_module("rospy.impl.tcpros_service")
    tcpros.recv_buff = service.recv_buff = _bounded_receive(tcpros)
    xmlrpc.SilenceableXMLRPCRequestHandler = _call_handler(xmlrpc.SilenceableXMLRPCRequestHandler)
    xmlrpc.ThreadingXMLRPCServer = _call_server(xmlrpc.ThreadingXMLRPCServer)


def _tcpros_server(base: Any, network: Any) -> Any:
    class Server(base):  # type: ignore[misc]
        """rospy's server, which passes a connection on after its header has arrived."""

        is_guarded = True
        port: int

        def _create_server_sock(self) -> Any:
            listener = open_listener(network.get_bind_address(), self.port, "ROS 1 TCPROS")
            self.addr, self.port = listener.getsockname()[:2]
            self._headers = HeaderServer(listener, self.inbound_handler)
            return listener

        def run(self) -> None:
            """Accepts until `shutdown`."""
            self._headers.run()

        def shutdown(self) -> None:
            """Ends `run`, which closes the listener."""
            self.is_shutdown = True
            self._headers.stop()

    return Server


def _bounded_receive(tcpros: Any) -> Any:
    receive = tcpros.recv_buff

    def bounded(connection: socket.socket, buffer: Any, buffer_bytes: int) -> int:
        """Reads into the buffer like rospy, at most MAX_MESSAGE_BYTES of one message."""
        if buffer.tell() > MAX_MESSAGE_BYTES:
            raise tcpros.TransportTerminated(f"sends more than {MAX_MESSAGE_BYTES >> 20} MiB")
        return int(receive(connection, buffer, buffer_bytes))

    return bounded


def _call_handler(base: Any) -> Any:
    class Handler(base):  # type: ignore[misc]
        """rospy's handler, for short calls of programs."""

        timeout = CALL_S

        def do_POST(self) -> None:  # noqa: N802
            """Implements the method of `http.server`."""
            refusal = _refusal(self.headers)
            if refusal is None:
                super().do_POST()
            else:
                self.close_connection = True
                self.send_error(*refusal)

    return Handler


def _refusal(headers: Any) -> tuple[HTTPStatus, str] | None:
    """Returns status and reason of a refused XML-RPC request; None if it is accepted."""
    if is_of_a_page(headers):
        return HTTPStatus.FORBIDDEN, "only programs may call this"
    length = headers.get("Content-Length", "")
    if not (length.isascii() and length.isdecimal()):
        return HTTPStatus.LENGTH_REQUIRED, "the length of the body is missing"
    if len(length) > len(str(MAX_CALL_BYTES)) or int(length) > MAX_CALL_BYTES:
        return HTTPStatus.REQUEST_ENTITY_TOO_LARGE, f"at most {MAX_CALL_BYTES} bytes"
    if headers.get("Content-Encoding", "identity") != "identity":
        return HTTPStatus.UNSUPPORTED_MEDIA_TYPE, "compressed bodies are not supported"
    return None


def is_of_a_page(headers: Mapping[str, str]) -> bool:
    """Returns whether a web page may have sent a request with these headers.

    A page of any site may post to any port of its user's machine, as long as the content type is
    one of those of forms. XML-RPC demands `text/xml`. Browsers name the page's origin in each POST;
    programs name none.

    Sources: Fetch Standard, "CORS-safelisted request-header"; XML-RPC Specification, "Header
    requirements"; RFC 6454 section 7.
    """
    kind = (headers.get("Content-Type") or "").partition(";")[0].strip().lower()
    return "Origin" in headers or not kind.endswith("/xml")


def _call_server(base: Any) -> Any:
    class Server(base):  # type: ignore[misc]
        """rospy's server, with a limit of connections."""

        socket: socket.socket
        server_address: Any

        def server_bind(self) -> None:
            """Listens within limits."""
            self.socket.close()
            host, port = self.server_address[:2]
            self.socket = open_listener(host, port, "ROS 1 XML-RPC", max_unproven=MAX_CALLERS)
            self.server_address = self.socket.getsockname()

        def server_activate(self) -> None:
            """Does nothing: the server listens already."""

        def register_multicall_functions(self) -> None:
            """Does nothing: one request is one call."""

        def get_request(self) -> Any:
            """Returns the next connection. Raises `OSError` if there is none now."""
            connection, address = self.socket.accept()
            connection.setblocking(True)
            return connection, address

    assert issubclass(Server, socketserver.BaseServer)
    return Server
