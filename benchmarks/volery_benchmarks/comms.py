"""Measures the radio network: many stations over loopback, and a server that is killed."""

from __future__ import annotations

import asyncio
import contextlib
import struct
import subprocess
import sys
import time
from collections.abc import Iterator
from functools import partial

import numpy as np

from volery.comms.addresses import Identity
from volery.comms.protocol import StationFrame, StationFrameKind
from volery.comms.station.tcp import Station
from volery.core.errors import CommsError

_STATIONS = 64
_RATE_PER_S = 5000
_BYTES = 256
_WARM_UP_S = 1.0
_STEADY_S = 8.0
_AROUND_KILL_S = 2.0
_SETTLE_S = 10.0
_SLICE_S = 0.002

_STAMP = struct.Struct("<qI")
"""Time of sending, ns of the monotonic clock, and number within the pair."""


def measure(
    stations: int = _STATIONS, rate_per_s: int = _RATE_PER_S, steady_s: float = _STEADY_S
) -> dict[str, float]:
    """Returns rate and latency in steady traffic, then loss and order across a killed server."""
    return asyncio.run(_measure(stations, rate_per_s, steady_s))


@contextlib.contextmanager
def served(port: int = 0) -> Iterator[tuple[subprocess.Popen[str], int]]:
    """Runs a communication server in its own process; yields it and its port; kills it."""
    command = [sys.executable, "-P", "-m", "volery.cli.app", "comms", "--port", str(port)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    try:
        said = process.stdout.readline()
        if not said.startswith("open"):
            raise CommsError(f"the communication server did not start: {said.strip()}")
        yield process, int(said.rpartition(":")[2])
    finally:
        process.kill()
        process.wait()
        process.stdout.close()


class Traffic:
    """Runs stations that send to one another in turns, and counts the deliveries."""

    def __init__(self, port: int, count: int) -> None:
        self._stations = [
            Station(Identity.of(k), partial(self._take, k), port=port) for k in range(count)
        ]
        self._sent: dict[tuple[int, int], int] = {}
        self._got: dict[tuple[int, int], int] = {}
        self._turn = 0
        self.latencies_ns: list[int] = []
        """Latencies from sending to the handler, ns."""
        self.came = 0
        self.reordered = 0
        """Number of messages that arrived after later ones of their pair, or twice."""

    @property
    def sent(self) -> int:
        """Number of messages sent."""
        return sum(self._sent.values())

    @property
    def joined(self) -> bool:
        """Whether every station is connected."""
        return all(station.joined for station in self._stations)

    async def start(self) -> None:
        """Connects all stations."""
        await asyncio.gather(*(station.start(30.0) for station in self._stations))

    async def stop(self) -> None:
        """Disconnects all stations."""
        await asyncio.gather(*(station.stop() for station in self._stations))

    async def flow(self, rate_per_s: float, seconds: float) -> float:
        """Sends at a steady rate; returns the time that it took, s."""
        began, sent = time.perf_counter(), 0
        while (passed := time.perf_counter() - began) < seconds:
            while sent < passed * rate_per_s:
                self._send_one()
                sent += 1
            await asyncio.sleep(_SLICE_S)
        return time.perf_counter() - began

    async def until_quiet(self, seconds: float) -> None:
        """Waits until all messages have arrived, at most `seconds`."""
        with contextlib.suppress(TimeoutError, asyncio.TimeoutError):
            await asyncio.wait_for(self._all_came(), seconds)

    async def _all_came(self) -> None:
        while self.came < self.sent:
            await asyncio.sleep(0.01)

    def _send_one(self) -> None:
        count = len(self._stations)
        source, step = self._turn % count, 1 + self._turn // count % (count - 1)
        to = (source + step) % count
        self._turn += 1
        number = self._sent[source, to] = self._sent.get((source, to), 0) + 1
        stamp = _STAMP.pack(time.monotonic_ns(), number)
        self._stations[source].send(StationFrameKind.SENSING, to, stamp.ljust(_BYTES, b"\0"))

    def _take(self, to: int, frame: StationFrame) -> None:
        sent_ns, number = _STAMP.unpack_from(frame.payload)
        self.latencies_ns.append(time.monotonic_ns() - sent_ns)
        pair = frame.source, to
        before = self._got.get(pair, 0)
        self.reordered += number <= before
        self._got[pair] = max(number, before)
        self.came += 1


async def _measure(stations: int, rate_per_s: int, steady_s: float) -> dict[str, float]:
    with served() as (first, port):
        traffic = Traffic(port, stations)
        await traffic.start()
        try:
            await traffic.flow(rate_per_s, _WARM_UP_S)
            await traffic.until_quiet(_SETTLE_S)
            traffic.latencies_ns.clear()
            before = traffic.came
            took_s = await traffic.flow(rate_per_s, steady_s)
            rate = (traffic.came - before) / took_s
            await traffic.until_quiet(_SETTLE_S)
            latencies_ms = np.asarray(traffic.latencies_ns) / 1e6
            first.kill()
            rejoin_s = await _restarted(traffic, port, rate_per_s)
        finally:
            await traffic.stop()
    p50, p99 = np.percentile(latencies_ms, (50, 99))
    return {
        "messages_per_s": rate,
        "p50_ms": float(p50),
        "p99_ms": float(p99),
        "lost": float(traffic.sent - traffic.came),
        "reordered": float(traffic.reordered),
        "rejoin_s": rejoin_s,
    }


async def _restarted(traffic: Traffic, port: int, rate_per_s: int) -> float:
    """Sends during the server's absence; returns seconds from listening to the last welcome."""
    flowing = asyncio.create_task(traffic.flow(rate_per_s / 10, _AROUND_KILL_S))
    await asyncio.sleep(0.2)
    again = served(port)
    await asyncio.to_thread(again.__enter__)
    try:
        listens = time.perf_counter()
        while not traffic.joined:
            await asyncio.sleep(0.005)
        rejoin_s = time.perf_counter() - listens
        await flowing
        await traffic.until_quiet(_SETTLE_S)
    finally:
        again.__exit__(None, None, None)
    return rejoin_s
