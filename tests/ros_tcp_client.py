"""A plain ROS-TCP client and a graph worked off by a thread. It shares no code with the bridges."""

from __future__ import annotations

import contextlib
import json
import queue
import socket
import struct
import threading
import time

from live_graph import LiveGraph


def until(what, timeout_s=180.0):
    """Wait for `what()` to be true, and return that."""
    end = time.monotonic() + timeout_s
    while time.monotonic() < end:
        found = what()
        if found:
            return found
        time.sleep(0.002)
    raise AssertionError("it did not happen in time")


def frame(destination, payload):
    name = destination.encode()
    return struct.pack("<I", len(name)) + name + struct.pack("<I", len(payload)) + payload


def ros1_string(text):
    data = text.encode()
    return struct.pack("<I", len(data)) + data


def cdr_string(text):
    data = text.encode() + b"\0"
    return b"\0\1\0\0" + struct.pack("<I", len(data)) + data


class Loop(LiveGraph):
    """A graph and the thread that works off what is posted."""

    def publish(self, publisher, message):
        self.do(lambda: publisher.publish(message))


class Client:
    """Plays the part of Unity's ROS-TCP-Connector."""

    def __init__(self, port, *, reading=True, keepalive=True, receive_buffer=None):
        self.sock = socket.socket()
        if receive_buffer:
            self.sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, receive_buffer)
        self.sock.settimeout(240.0)  # longer than any test waits: silence is no end
        self.sock.connect(("127.0.0.1", port))
        self.frames = queue.Queue()
        self.ended = threading.Event()
        if keepalive:
            self.sock.sendall(bytes(8))
        if reading:
            self.read()

    def read(self):
        threading.Thread(target=self._read, daemon=True).start()

    def send(self, destination, payload):
        self.sock.sendall(frame(destination, payload))

    def command(self, name, ending=b"", **fields):
        self.send(f"__{name}", json.dumps(fields).encode() + ending)

    def next(self, timeout_s=180.0):
        """The next frame; JSON is parsed."""
        destination, payload = self.frames.get(timeout=timeout_s)
        if destination.startswith("__"):
            return destination, json.loads(payload)
        return destination, payload

    def next_error(self):
        name, fields = self.next()
        assert name == "__error", (name, fields)
        return fields["text"]

    def synchronize(self):
        """Return when all that was sent has been worked off; drops the responses before it."""
        self.command("topic_list")
        while self.next()[0] != "__topic_list":
            pass

    def close(self):
        with contextlib.suppress(OSError):
            self.sock.shutdown(socket.SHUT_RDWR)
        self.sock.close()

    def _read(self):
        file = self.sock.makefile("rb")
        try:
            while True:
                (length,) = struct.unpack("<I", self._exactly(file, 4))
                destination = self._exactly(file, length).decode()
                (length,) = struct.unpack("<I", self._exactly(file, 4))
                self.frames.put((destination, self._exactly(file, length)))
        except (OSError, EOFError, ValueError):
            self.ended.set()

    @staticmethod
    def _exactly(file, count):
        data = file.read(count)
        if len(data) < count:
            raise EOFError
        return data
