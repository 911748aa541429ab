"""Makes bridges by the names of the command line: `rosbridge`, `ros-tcp=127.0.0.1:10001`.

    bridges.open(make_bridge("mavlink=14550", BridgeOptions(allow_remote=True)))

The names are entry points of the group `volery.bridges`: those that ship, and those that other
installed packages add.
"""

from __future__ import annotations

import pkgutil

from volery.core.entry_points import EntryPoints
from volery.core.errors import BridgeError
from volery.core.near_names import near_miss
from volery.graph.bridge_kind import (
    LOOPBACK,
    NO_PORT,
    Address,
    Bridge,
    BridgeKind,
    BridgeOptions,
)

__all__ = [
    "LOOPBACK",
    "NO_PORT",
    "Address",
    "Bridge",
    "BridgeKind",
    "BridgeOptions",
    "bridge_names",
    "make_bridge",
]

GROUP = "volery.bridges"


def make_bridge(text: str, options: BridgeOptions) -> Bridge:
    """Makes the bridge of `NAME`, `NAME=[HOST:]PORT` or `NAME=PATH[:BAUD]`.

    Raises `BridgeError` for an unknown name, a wrong address, or a bridge of another package that
    cannot be loaded.
    """
    name, _, address = text.partition("=")
    kind = _kind_of(name, EntryPoints(GROUP))
    parse = _parse_line if kind.is_serial else _parse
    return kind.make(parse(address, kind.port, text), options)


def bridge_names() -> list[str]:
    """Returns the names of all bridges, sorted."""
    return EntryPoints(GROUP).names()


def _kind_of(name: str, registry: EntryPoints) -> BridgeKind:
    target = registry.find(name)
    if target is None:
        raise BridgeError(_unknown(name, registry.names()))
    where = f"bridge '{name}' of package '{registry.package(name)}'"
    try:
        kind = pkgutil.resolve_name(target)
    except Exception as error:  # the package's module runs here
        reason = f"{type(error).__name__}: {error}"
        raise BridgeError(f"{where}: '{target}' cannot be imported: {reason}") from error
    if not isinstance(kind, BridgeKind):
        raise BridgeError(f"{where}: '{target}' is a {type(kind).__name__}, not a BridgeKind")
    return kind


def _unknown(name: str, names: list[str]) -> str:
    if not names:
        return (
            f"no bridge '{name}': the installed packages register no bridges; install Volery "
            "again (from its source folder: pip install -e .)"
        )
    hint = near_miss(name, names)
    return f"no bridge '{name}'{hint} Bridges: {', '.join(names)}"


def _parse(address: str, port: int, text: str) -> Address:
    host = LOOPBACK
    if address:
        before, colon, after = address.rpartition(":")
        if colon:
            host = before.strip("[]")
        if not after.isdecimal() or not 0 <= int(after) <= 65535:
            raise BridgeError(f"'{text}': use PORT or HOST:PORT, port 0 to 65535")
        port = int(after)
    return Address(host, port)


def _parse_line(address: str, baud: int, text: str) -> Address:
    path, colon, after = address.rpartition(":")
    if not colon:
        path = address
    elif after.isdecimal():
        baud = int(after)
    if not path or (colon and not after.isdecimal()):
        raise BridgeError(f"'{text}': use PATH or PATH:BAUD for a serial line")
    return Address(path, baud)
