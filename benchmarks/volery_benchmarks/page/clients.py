"""Runs clients beside the page, over plain WebSockets, that read all messages.

python -m volery_benchmarks.page.clients URL CLIENTS SECONDS TOPIC...   prints a line when all are
connected, and at the end the losses as JSON
"""

from __future__ import annotations

import asyncio
import json
import sys
from collections import defaultdict
from typing import Any

from websockets.asyncio.client import connect

from volery_benchmarks.page.streams import lost, subscription

_SETTLING_S = 1.0


def main() -> None:
    """Reads for SECONDS and prints how many messages were lost."""
    url, clients, seconds, *topics = sys.argv[1:]
    print(json.dumps(asyncio.run(_read(url, int(clients), float(seconds), topics))))  # noqa: T201


async def _read(url: str, clients: int, seconds: float, topics: list[str]) -> dict[str, int]:
    there = asyncio.Barrier(clients)
    found = await asyncio.gather(*(_stamps(url, seconds, topics, there) for _ in range(clients)))
    series = [stamps for client in found for stamps in client.values()]
    return {
        "messages": sum(map(len, series)),
        "lost": sum(map(lost, series)),
        "silent": clients * len(topics) - len(series),
    }


async def _stamps(
    url: str, seconds: float, topics: list[str], there: asyncio.Barrier
) -> dict[str, list[int]]:
    """Returns stamps, ns, by topic, of messages that arrive after all clients are connected."""
    stamps: dict[str, list[int]] = defaultdict(list)
    async with connect(url, max_size=None) as socket:
        for topic in topics:
            await socket.send(subscription(topic))
        if await there.wait() == 0:
            print("all are there", flush=True)  # noqa: T201
        loop = asyncio.get_running_loop()
        begins = loop.time() + _SETTLING_S
        while (left := begins + seconds - loop.time()) > 0:
            try:
                text = await asyncio.wait_for(socket.recv(), left)
            except TimeoutError:
                break
            message: dict[str, Any] = json.loads(text)
            if message.get("op") == "publish" and loop.time() >= begins:
                stamp = message["msg"]["header"]["stamp"]
                stamps[message["topic"]].append(stamp["sec"] * 10**9 + stamp["nanosec"])
    return stamps


if __name__ == "__main__":
    main()
