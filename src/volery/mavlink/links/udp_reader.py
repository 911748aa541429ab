"""Reads UDP sockets of a MAVLink link, as far as the senders' account allows.

The configured peer of a link has its own socket: a second socket of the same port that is connected
to the peer. The system delivers this peer's datagrams there, so that a flood from other senders
does not displace them.
"""

from __future__ import annotations

import asyncio
import contextlib
import socket
from collections.abc import Callable
from typing import Any

from volery.mavlink.links.rate_limits import RateAccount

_DATAGRAMS_A_TURN = 32
"""Datagrams after which other sockets have their turn."""
_MAX_BYTES = 65535
_ERROR_PAUSE_S = 0.2
"""Pause after the system reported that a port has no receiver, which it does for each datagram."""

Take = Callable[[bytes, Any, RateAccount], tuple[bytes, float]]
"""Parses a datagram and its sender; returns its frames, and how long (s) none must be read."""


class UdpReader:
    """Reads one socket in the running loop.

    take: called for each datagram. deliver: called with the joined frames of a turn. may_read:
    returns for how many seconds nothing must be read now.
    """

    def __init__(
        self,
        sock: socket.socket,
        account: RateAccount,
        take: Take,
        deliver: Callable[[bytes], None],
        may_read: Callable[[], float],
    ) -> None:
        self.socket = sock
        self._account = account
        self._take, self._deliver = take, deliver
        self._may_read = may_read
        self._pause: asyncio.TimerHandle | None = None
        self._loop = asyncio.get_running_loop()
        self._loop.add_reader(sock, self._read)

    def close(self) -> None:
        """Closes the socket."""
        self._account.close()
        if self._pause is not None:
            self._pause.cancel()
        self._loop.remove_reader(self.socket)
        self.socket.close()

    def _read(self) -> None:
        """Delivers the datagrams of a turn."""
        frames, pause_s = [], 0.0
        for _ in range(_DATAGRAMS_A_TURN):
            try:
                data, peer = self.socket.recvfrom(_MAX_BYTES)
            except (BlockingIOError, InterruptedError):
                break
            except OSError:
                pause_s = _ERROR_PAUSE_S
            else:
                accepted, pause_s = self._take(data, peer, self._account)
                frames.append(accepted)
            if pause_s > 0.0:
                self._loop.remove_reader(self.socket)
                self._read_after(pause_s)
                break
        joined = b"".join(frames)
        if joined:
            self._deliver(joined)

    def _read_after(self, pause_s: float) -> None:
        self._pause = self._loop.call_later(pause_s, self._read_again)

    def _read_again(self) -> None:
        pause_s = max(self._account.charge(), self._may_read())
        if pause_s > 0.0:
            self._read_after(pause_s)
        else:
            self._loop.add_reader(self.socket, self._read)


def connected_socket(bound: socket.socket, peer: tuple[str, int]) -> socket.socket | None:
    """Returns a socket of the same port that is connected to a peer; None if that is impossible.

    Both sockets share the port for a moment only; afterwards it is taken for all others, as before.
    """
    connected = socket.socket(bound.family, socket.SOCK_DGRAM)
    connected.setblocking(False)
    try:
        for sock in (bound, connected):
            sock.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEPORT, 1)
        connected.bind(bound.getsockname())
        connected.connect(peer)
    except OSError:
        connected.close()
        return None
    finally:
        for sock in (bound, connected):
            with contextlib.suppress(OSError):
                sock.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEPORT, 0)
    return connected
