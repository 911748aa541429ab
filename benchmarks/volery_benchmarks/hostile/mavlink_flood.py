"""Sends 10,000 MAVLink frames a second by TCP and UDP, with noise in between."""

from __future__ import annotations

import socket
import time
from collections.abc import Sequence
from contextlib import suppress
from functools import cache
from typing import Any

from volery.mavlink.codec import dialect
from volery.mavlink.links import ports

FRAMES_HZ = 10_000
_BURSTS_HZ = 100
_NOISE = bytes(range(251)) * 8
_READ_BYTES = 1 << 20
_ALL_LOGS, _WHOLE_LOG = 0xFFFF, 0xFFFFFFFF
_GROUND_STATION, _NO_AUTOPILOT, _MAVLINK = 6, 8, 3


@cache
def frames() -> Sequence[bytes]:
    """Returns valid frames for system 1: heartbeat, manual control, parameters, flight logs."""
    make = dialect()
    messages: Sequence[Any] = (
        make.MAVLink_heartbeat_message(_GROUND_STATION, _NO_AUTOPILOT, 0, 0, 0, _MAVLINK),
        make.MAVLink_manual_control_message(1, 0, 0, 500, 0, 0),
        make.MAVLink_param_request_read_message(1, 1, b"RTL_RETURN_ALT", -1),
        make.MAVLink_param_request_list_message(1, 1),
        make.MAVLink_log_request_list_message(1, 1, 0, _ALL_LOGS),
        make.MAVLink_log_request_data_message(1, 1, 0, 0, _WHOLE_LOG),
    )
    codec = make.MAVLink(None, 245, 190)
    return tuple(message.pack(codec) for message in messages)


def flood(tcp_port: int, udp_port: int, ends: float) -> int:
    """Sends until a time of the monotonic clock; returns how many frames.

    udp_port: of the bridge `mavlink=PORT`. A client that is disconnected connects again.
    """
    sent = 0
    while time.monotonic() < ends:
        with suppress(OSError), socket.create_connection(("127.0.0.1", tcp_port), 10.0) as stream:
            stream.setblocking(False)
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as datagrams:
                datagrams.connect(("127.0.0.1", udp_port + ports.ONBOARD_FROM - ports.ONBOARD_TO))
                datagrams.setblocking(False)
                sent += _send(stream, datagrams, ends)
        time.sleep(0.01)
    return sent


def _send(stream: socket.socket, datagrams: socket.socket, ends: float) -> int:
    """Sends half of the frames each way and buffers what TCP does not accept. Raises `OSError`."""
    chosen, half = frames(), FRAMES_HZ // _BURSTS_HZ // 2
    sent, waiting, due = 0, b"", time.monotonic()
    while time.monotonic() < ends:
        burst = [chosen[k % len(chosen)] for k in range(sent, sent + half)]
        for frame in (*burst, _NOISE[:250]):
            with suppress(OSError):
                datagrams.send(frame)
        waiting = waiting or b"".join((*burst, _NOISE))
        with suppress(BlockingIOError):
            waiting = waiting[stream.send(waiting) :]
        for reader in (stream, datagrams):
            with suppress(BlockingIOError, ConnectionRefusedError):
                while reader.recv(_READ_BYTES):
                    pass
        sent += 2 * half
        due = max(due + 1.0 / _BURSTS_HZ, time.monotonic() - 0.1)
        time.sleep(max(0.0, due - time.monotonic()))
    return sent
