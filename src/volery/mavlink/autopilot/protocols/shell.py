"""The system shell over SERIAL_CONTROL: a few read-only commands, with PX4's prompt."""

from __future__ import annotations

from typing import Any

from volery.mavlink.autopilot.context import AutopilotContext
from volery.mavlink.autopilot.parameters import NAMES
from volery.mavlink.autopilot.state import Source
from volery.mavlink.codec import dialect

_SHELL_DEVICE = 10
_REPLY, _RESPOND = 1, 2
"""Values of SERIAL_CONTROL_DEV and SERIAL_CONTROL_FLAG."""
_CHUNK_BYTES = 70
_MAX_LINE = 200
_MAX_SHELLS = 8
_PROMPT = "pxh> "
_HELP = {
    "help": "lists the commands",
    "param show [NAME]": "prints parameters; NAME may end with *",
    "ver": "prints the versions",
}


def take(context: AutopilotContext, source: Source, message: Any) -> None:
    """Runs a line that a SERIAL_CONTROL message completes, and replies if requested.

    One line per message: the rest of the message is dropped.
    """
    shells = context.memory.shells
    if message.device != _SHELL_DEVICE or message.flags & _REPLY or context.memory.state is None:
        return
    text = shells.pop(source, "") + bytes(message.data[: message.count]).decode("ascii", "replace")
    text = text.replace("\r", "\n").replace("\0", "")
    reply = ""
    line, ended, _ = text.partition("\n")
    if ended:
        reply = f"{_run(context, line.split())}{_PROMPT}"
    elif len(line) <= _MAX_LINE and len(shells) < _MAX_SHELLS:
        shells[source] = line
    if message.flags & _RESPOND:
        _reply(context, source, reply)


def _run(context: AutopilotContext, words: list[str]) -> str:
    """Returns the output of a command."""
    if not words:
        return ""
    if words == ["help"]:
        return "Commands:\n" + "".join(f"  {name:<18} {what}\n" for name, what in _HELP.items())
    if words[0] == "ver":
        return f"HW arch: volery {context.build.airframe}\nPX4 version: 1.18.0 (simulated)\n"
    if words[:2] == ["param", "show"] and len(words) <= 3:
        wanted = words[2] if len(words) == 3 else "*"
        return _parameters(context, wanted)
    return f"Invalid command: {' '.join(words)[:40]}\ntype 'help' for a list of commands\n"


def _parameters(context: AutopilotContext, wanted: str) -> str:
    prefix = wanted.removesuffix("*")
    found = [
        name for name in NAMES if name == wanted or (name.startswith(prefix) and wanted[-1:] == "*")
    ]
    return "".join(f"  {name}: {context.parameter(name):g}\n" for name in found) or "no parameter\n"


def _reply(context: AutopilotContext, source: Source, text: str) -> None:
    raw = text.encode("ascii", "replace")
    control = dialect().MAVLink_serial_control_message
    for k in range(0, len(raw), _CHUNK_BYTES):
        piece = raw[k : k + _CHUNK_BYTES]
        data = list(piece.ljust(_CHUNK_BYTES, b"\0"))
        context.links.send(control(_SHELL_DEVICE, _REPLY, 0, 0, len(piece), data), source[0])
