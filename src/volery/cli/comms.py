"""`volery comms`: runs the communication server until Ctrl-C."""

from __future__ import annotations

import asyncio
import contextlib
import signal

from volery.cli.terminal import echo_line
from volery.comms.server.settings import RouterSettings
from volery.comms.server.statistics import Statistics
from volery.comms.server.tcp import CommsServer

_SUMMARY_PERIOD_S = 10.0


def serve_stations(host: str, port: int, settings: RouterSettings, *, anywhere: bool) -> None:
    """Serves stations; prints a summary every ten seconds if something changed.

    SIGINT, SIGTERM and SIGHUP end the server, even if a shell started it in the background with
    SIGINT ignored. A second signal of the same kind ends it at once.
    """
    asyncio.run(_serve(CommsServer(settings, host, port, anywhere=anywhere)))


async def _serve(server: CommsServer) -> None:
    ended = asyncio.Event()
    loop = asyncio.get_running_loop()

    def end(number: signal.Signals) -> None:
        ended.set()
        loop.remove_signal_handler(number)

    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        if number is signal.SIGHUP and signal.getsignal(number) is signal.SIG_IGN:
            continue  # `nohup`
        loop.add_signal_handler(number, end, number)
    await server.start()
    echo_line(f"open    {server.name}")
    last_line = ""
    try:
        while not ended.is_set():
            with contextlib.suppress(TimeoutError, asyncio.TimeoutError):
                await asyncio.wait_for(ended.wait(), _SUMMARY_PERIOD_S)
            line = summary(server.statistics)
            if line != last_line:
                echo_line(line)
            last_line = line
    finally:
        await server.stop()


def summary(counted: Statistics) -> str:
    """Returns the main counts in one line."""
    refused = sum(counted.refused.values())
    lost = counted.dropped_sensing + counted.flooded + counted.expired + counted.lost_on_link
    return (
        f"stations {counted.present} here, {counted.away} away · messages {counted.accepted} in, "
        f"{counted.delivered} out, {counted.waiting} waiting, {lost} lost by rule · "
        f"{refused} refused · damaged frames {sum(counted.corrupt.values())}"
    )
