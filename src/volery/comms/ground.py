"""A ground station without terminal and sockets: lines of people in, messages and lines out."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

from volery.comms.addresses import PLANES_PER_BATCH, Identity, is_station
from volery.comms.bodies import Refusal
from volery.comms.payloads import (
    COMMANDS,
    REPLY,
    REPLY_TYPE,
    STATE,
    STATE_TYPE,
    decode_named,
    encode_named,
)
from volery.comms.protocol import Frame, Kind
from volery.comms.targets import address_of
from volery.core.clock import NS_PER_S
from volery.core.errors import CommsError
from volery.graph.messages import Point, message_type

Send = Callable[[Kind, int, bytes], int]

HELP = """\
list                        state of each UAV
take_off WHO [ALTITUDE]     m above where it stands
land WHO                    where it is
hold WHO                    where it is
return WHO                  home, and land
go_to WHO X Y Z [HEADING]   m in the map; degrees from its x axis to the left
help                        this
quit                        leave

WHO: a linear id such as 3, batch.plane such as 0.3, a name such as uav4, batch1, or all."""

_SIMPLE = {"land": "land", "hold": "hold", "return": "return_home"}


class Row(NamedTuple):
    """One UAV, for a table."""

    name: str
    address: str
    mode: str
    position: str
    speed: str
    battery: str
    age: str


HEAD = ("UAV", "station", "mode", "position (m)", "speed (m/s)", "battery", "heard (s ago)")


class Ground:
    """Knows what UAVs tell, and turns lines into commands.

    send: sends a message, as `Station.send`. planes_per_batch: as of the server.
    """

    def __init__(self, send: Send, planes_per_batch: int = PLANES_PER_BATCH) -> None:
        self._send = send
        self._planes = planes_per_batch
        self._states: dict[int, tuple[Any, int]] = {}
        self._asked: dict[int, str] = {}

    def take(self, frame: Frame, now_ns: int) -> str | None:
        """Take a message; a line to be shown, where there is something to say."""
        try:
            named = decode_named(frame.payload)
        except CommsError as error:
            return f"{self._name(frame.source)}: {error}"
        if named[:2] == (STATE, STATE_TYPE):
            before = self._states.get(frame.source)
            self._states[frame.source] = named.message, now_ns
            mode = named.message.mode
            changed = before is None or before[0].mode != mode
            return f"{self._name(frame.source)}: {mode}" if changed else None
        if named[:2] == (REPLY, REPLY_TYPE):
            return f"{self._name(frame.source)}: {named.message.data}"
        return f"{self._name(frame.source)}: {named.name} ({named.msgtype})"

    def refused(self, refusal: Refusal) -> str:
        """Line about what the server refused."""
        asked = self._asked.get(refusal.sequence)
        return f"refused: {asked + ': ' if asked else ''}{refusal.text}"

    def rows(self, now_ns: int) -> list[Row]:
        """Every UAV that has been heard, by address."""
        return [
            self._row(address, state, now_ns - heard_ns)
            for address, (state, heard_ns) in sorted(self._states.items())
        ]

    def command(self, line: str) -> str:
        """Send the command of a line; a line that says so. `CommsError` where it is none."""
        word, *rest = line.split()
        fields: dict[str, Any] = {}
        if word in _SIMPLE and len(rest) == 1:
            name = _SIMPLE[word]
        elif word == "take_off" and len(rest) == 1:
            name = "take_off"
        elif word == "take_off" and len(rest) == 2:
            name, fields = "take_off_to", {"altitude": _number(rest[1])}
        elif word == "go_to" and len(rest) in (4, 5):
            name, fields = "go_to", _place(rest[1:])
        else:
            raise CommsError(f"'{line.strip()}' is no command; help shows them")
        names = {state.name: address for address, (state, _) in self._states.items()}
        address = address_of(rest[0], self._planes, names)
        request = f"{COMMANDS[name]}_Request"
        message = message_type(request)(**fields)
        sequence = self._send(Kind.COMMAND, address, encode_named(name, request, message))
        said = f"{name} to {rest[0]}"
        self._asked[sequence] = said
        return f"sent: {said}"

    def _name(self, address: int) -> str:
        known = self._states.get(address)
        if known is not None and known[0].name:
            return str(known[0].name)
        return self._label(address)

    def _label(self, address: int) -> str:
        if not is_station(address):
            return str(address)
        identity = Identity.of(address, self._planes)
        if identity == Identity.ground(identity.plane):
            return f"ground{identity.plane}"
        return f"{identity.batch}.{identity.plane}"

    def _row(self, address: int, state: Any, age_ns: int) -> Row:
        place, velocity = state.position, state.velocity
        speed = math.hypot(velocity.x, velocity.y, velocity.z)
        return Row(
            state.name,
            self._label(address),
            state.mode,
            f"{place.x:.1f} {place.y:.1f} {place.z:.1f}",
            f"{speed:.1f}",
            "-" if math.isnan(state.battery) else f"{100.0 * state.battery:.0f} %",
            f"{age_ns / NS_PER_S:.1f}",
        )


def _place(words: list[str]) -> dict[str, Any]:
    heading = math.radians(_number(words[3])) if len(words) == 4 else 0.0
    x, y, z = map(_number, words[:3])
    return {"position": Point(x, y, z), "yaw": heading, "keep_heading": len(words) < 4}


def _number(word: str) -> float:
    try:
        value = float(word)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise CommsError(f"'{word}' is no number")
    return value
