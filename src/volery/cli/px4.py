"""`volery px4`: PX4s for a simulation that runs elsewhere, until Ctrl-C."""

from __future__ import annotations

import threading
from pathlib import Path
from types import FrameType

import typer

from volery.cli.interrupt import StopSignals
from volery.core.errors import BridgeError
from volery.mavlink.px4_processes import Px4Instances, find_px4

_LOOK_S = 0.5


def run_px4(
    px4_dir: Path,
    count: int,
    *,
    first: int,
    host: str,
    folder: Path | None,
    speed: float | None,
) -> None:
    """Run instances until a signal ends them; `BridgeError` where one cannot start or ends."""
    ended = threading.Event()

    def end(_signal: int, _frame: FrameType | None) -> None:
        if ended.is_set():
            raise KeyboardInterrupt
        ended.set()

    build = find_px4(px4_dir)
    with (
        StopSignals(end),
        Px4Instances(build, count, first=first, host=host, folder=folder, speed=speed) as instances,
    ):
        last = first + count - 1
        typer.echo(f"started {build.binary}, instances {first} to {last}; Ctrl-C ends them")
        while not ended.is_set() and not instances.wait(_LOOK_S):
            pass
        if instances.failure is not None:
            raise BridgeError(instances.failure)
