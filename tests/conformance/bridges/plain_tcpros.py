"""A ROS 1 node of the standard library alone: XML-RPC with the master, TCPROS with others."""

from __future__ import annotations

import contextlib
import socket
import struct
import threading
from xmlrpc.client import ServerProxy
from xmlrpc.server import SimpleXMLRPCServer

SUMS = {
    "std_msgs/String": "992ce8a1687cec8c8bd883ec73ca41d1",
    "sensor_msgs/Image": "060021388200f6f0f447d0fcd9c64743",
    "std_srvs/Trigger": "937c9679a518e3a18d831e57125ea522",
}
WRONG_SUM = "0123456789abcdef0123456789abcdef"


class PlainNode:
    """Publishes, subscribes, calls and offers; each connection has a thread of its own.

    What comes is handed to `take(topic, data)`; what other nodes refuse to `refused(text)`.
    """

    def __init__(self, master_uri, name, take, refused):
        self.name = name
        self.master = ServerProxy(master_uri)
        self._take = take
        self._refused = refused
        self._subscribed = {}
        self._published = {}
        self._services = {}
        self._connected = set()
        self._sockets = []
        self._threads = []
        self._registered = []
        self._server = SimpleXMLRPCServer(("127.0.0.1", 0), logRequests=False, allow_none=True)
        self._server.register_instance(self)
        self.uri = f"http://127.0.0.1:{self._server.server_address[1]}"
        threading.Thread(target=self._server.serve_forever, args=(0.05,), daemon=True).start()
        self._listener = socket.socket()
        self._listener.bind(("127.0.0.1", 0))
        self._listener.listen(16)
        self._port = self._listener.getsockname()[1]
        self._start(self._accept)

    # ------------------------------------------------------------------- what the master calls

    def publisherUpdate(self, _caller, topic, uris):
        for uri in uris:
            self._start(self._connect, topic, uri)
        return 1, "", 0

    def requestTopic(self, _caller, topic, _protocols):
        if topic not in self._published:
            return 0, "not published", 0
        return 1, "", ["TCPROS", "127.0.0.1", self._port]

    def getPid(self, _caller):
        return 1, "", 0

    # ------------------------------------------------------------------------------------- topics

    def subscribe(self, topic, kind, *, md5=None, reading=True):
        self._subscribed[topic] = (kind, md5 or SUMS[kind], reading)
        _, _, uris = self.master.registerSubscriber(self.name, topic, kind, self.uri)
        self._registered.append(("unregisterSubscriber", topic, self.uri))
        self.publisherUpdate("", topic, uris)

    def advertise(self, topic, kind, *, latched=False, md5=None):
        self._published[topic] = _Publication(kind, md5 or SUMS[kind], latched)
        self.master.registerPublisher(self.name, topic, kind, self.uri)
        self._registered.append(("unregisterPublisher", topic, self.uri))

    def readers(self, topic):
        """How many are connected to a topic of ours."""
        return len(self._published[topic].readers)

    def publish(self, topic, data):
        self._published[topic].send(struct.pack("<I", len(data)) + data)

    def publish_raw(self, topic, data):
        """Send bytes as they are, a part of a frame perhaps."""
        self._published[topic].send(data)

    # ----------------------------------------------------------------------------------- services

    def call(self, service, kind, request=b"", *, md5=None):
        """The response; `ConnectionError` with the reason without one."""
        code, text, uri = self.master.lookupService(self.name, service)
        if code != 1:
            raise ConnectionError(text)
        host, port = uri.removeprefix("rosrpc://").rstrip("/").split(":")
        with socket.create_connection((host, int(port)), 10.0) as sock, sock.makefile("rb") as file:
            fields = {"service": service, "type": kind, "md5sum": md5 or SUMS[kind]}
            response = self._greet(sock, file, **fields)
            if "error" in response:
                raise ConnectionError(response["error"])
            sock.sendall(struct.pack("<I", len(request)) + request)
            well = _exactly(file, 1)
            body = _exactly(file, *struct.unpack("<I", _exactly(file, 4)))
            if well != b"\1":
                raise ConnectionError(body.decode(errors="replace"))
            return body

    def create_service(self, service, kind, response):
        """Create a service that always responds with the same bytes, or never if they are None."""
        self._services[service] = (kind, response)
        address = f"rosrpc://127.0.0.1:{self._port}"
        self.master.registerService(self.name, service, address, self.uri)
        self._registered.append(("unregisterService", service, address))

    # ---------------------------------------------------------------------------------------- end

    def close(self, *, unregister=True):
        """Leave; unless `unregister`, the master is not informed, and connections are reset."""
        if self._listener.fileno() < 0:
            return
        for method, name, where in self._registered if unregister else ():
            with contextlib.suppress(OSError):
                getattr(self.master, method)(self.name, name, where)
        self._server.shutdown()
        self._server.server_close()
        with contextlib.suppress(OSError):
            self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()
        for sock in self._sockets:
            with contextlib.suppress(OSError):
                sock.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
                sock.shutdown(socket.SHUT_RD)
        for thread in self._threads:
            thread.join(5.0)
        for sock in self._sockets:
            sock.close()
        self.master("close")()

    # ------------------------------------------------------------------------------- connections

    def _start(self, job, *arguments):
        thread = threading.Thread(target=job, args=arguments, daemon=True)
        self._threads.append(thread)
        thread.start()

    def _connect(self, topic, uri):
        """Read what a publisher of a topic sends."""
        kind, md5, reading = self._subscribed.get(topic, (None, None, None))
        if kind is None or uri == self.uri or (topic, uri) in self._connected:
            return
        self._connected.add((topic, uri))
        with contextlib.suppress(OSError, EOFError):
            with ServerProxy(uri) as publisher:
                code, text, address = publisher.requestTopic(self.name, topic, [["TCPROS"]])
            if code != 1:
                self._connected.discard((topic, uri))
                self._refused(text)
                return
            sock = socket.socket()
            self._sockets.append(sock)
            if not reading:
                sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
            sock.connect((address[1], address[2]))
            with sock.makefile("rb") as file:
                response = self._greet(sock, file, topic=topic, type=kind, md5sum=md5)
                if "error" in response:
                    self._refused(response["error"])
                    return
                while reading:
                    data = _exactly(file, *struct.unpack("<I", _exactly(file, 4)))
                    self._take(topic, data)

    def _greet(self, sock, file, **fields):
        sock.sendall(_header({"callerid": self.name, **fields}))
        return _read_header(file)

    def _accept(self):
        with contextlib.suppress(OSError):
            while True:
                sock, _ = self._listener.accept()
                self._sockets.append(sock)
                self._start(self._serve, sock)

    def _serve(self, sock):
        with contextlib.suppress(OSError, EOFError), sock.makefile("rb") as file:
            asked = _read_header(file)
            if "service" in asked:
                kind, response = self._services[asked["service"]]
                sock.sendall(_header({"callerid": self.name, "type": kind, "md5sum": SUMS[kind]}))
                if asked.get("probe") == "1":
                    return
                _exactly(file, *struct.unpack("<I", _exactly(file, 4)))
                if response is None:
                    file.read(1)  # until the caller gives up
                else:
                    sock.sendall(b"\1" + struct.pack("<I", len(response)) + response)
                return
            publication = self._published[asked["topic"]]
            if asked["md5sum"] not in ("*", publication.md5):
                sock.sendall(_header({"error": f"md5sums do not match: {publication.md5}"}))
                return
            fields = {"type": publication.kind, "md5sum": publication.md5}
            latching = {"latching": "1" if publication.latched else "0"}
            sock.sendall(_header({"callerid": self.name, **fields, **latching}))
            publication.join(sock)
            file.read(1)  # until the subscriber goes
            publication.leave(sock)


class _Publication:
    """A topic of the node and its readers."""

    def __init__(self, kind, md5, latched):
        self.kind = kind
        self.md5 = md5
        self.latched = latched
        self.readers = []
        self._kept = None
        self._lock = threading.Lock()

    def join(self, sock):
        with self._lock:
            if self._kept is not None:
                sock.sendall(self._kept)
            self.readers.append(sock)

    def leave(self, sock):
        with self._lock:
            self.readers.remove(sock)

    def send(self, data):
        with self._lock:
            if self.latched:
                self._kept = data
            for sock in self.readers:
                sock.sendall(data)


def _header(fields):
    lines = [f"{key}={value}".encode() for key, value in fields.items()]
    body = b"".join(struct.pack("<I", len(line)) + line for line in lines)
    return struct.pack("<I", len(body)) + body


def _read_header(file):
    body = _exactly(file, *struct.unpack("<I", _exactly(file, 4)))
    fields = {}
    while body:
        (length,) = struct.unpack_from("<I", body)
        key, _, value = body[4 : 4 + length].decode().partition("=")
        fields[key], body = value, body[4 + length :]
    return fields


def _exactly(file, count):
    data = file.read(count)
    if len(data) < count:
        raise EOFError
    return data
