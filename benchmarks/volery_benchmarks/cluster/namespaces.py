"""Two network namespaces of this machine: machines with an address and a core of their own.

They need root, `ip` and `taskset`.
"""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager

from volery.core.errors import VoleryError
from volery.core.machine import usable_cores

NAMES = ("volery_bench_a", "volery_bench_b")
ADDRESSES = ("10.77.0.1", "10.77.0.2")


def what_is_missing() -> str:
    """Returns why two machines cannot be had here; empty: they can."""
    if os.geteuid() or shutil.which("ip") is None or shutil.which("taskset") is None:
        return "root, ip and taskset are needed for network namespaces"
    return "" if usable_cores() > 1 else "a second core"


@contextmanager
def namespaces() -> Iterator[None]:
    """Makes two namespaces, joined by a pair of virtual interfaces."""
    first, second = NAMES
    with ExitStack() as made:
        for name in NAMES:
            _ip("netns", "add", name)
            made.callback(_ip, "netns", "del", name)
        pair = ("type", "veth", "peer", "name", "peer", "netns", second)
        _ip("link", "add", "peer", "netns", first, *pair)
        for name, address in zip(NAMES, ADDRESSES, strict=True):
            _ip("-n", name, "addr", "add", f"{address}/24", "dev", "peer")
            for device in ("peer", "lo"):
                _ip("-n", name, "link", "set", device, "up")
        yield


def cut_link() -> None:
    """Cuts the link silently: frames go to an address that no interface has."""
    for name, peer in zip(NAMES, ADDRESSES[::-1], strict=True):
        nowhere = ("lladdr", "02:00:00:00:00:99", "nud", "permanent", "dev", "peer")
        _ip("-n", name, "neigh", "replace", peer, *nowhere)


def on(machine: int, command: Sequence[str]) -> list[str]:
    """Returns a command that runs on a machine, which has one core."""
    return ["ip", "netns", "exec", NAMES[machine], "taskset", "-c", str(machine), *command]


def _ip(*words: str) -> None:
    done = subprocess.run(["ip", *words], capture_output=True, text=True, check=False)
    if done.returncode:
        raise VoleryError(f"ip {' '.join(words)}: {done.stderr.strip()}")
