"""A ground station without terminal and sockets: command lines in, messages and text out.

It parses addresses as users write them, and tells how old a state is although clocks differ.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from volery.comms.addresses import ALL, GROUP_SIZE, Identity, batch_address, is_meant, is_station
from volery.comms.control_payloads import Refusal
from volery.comms.payloads import (
    COMMANDS,
    MISSION,
    MISSION_TYPE,
    REPLY,
    REPLY_TYPE,
    SLAM,
    SLAM_TYPE,
    STATE,
    STATE_TYPE,
    decode_named,
    encode_named,
)
from volery.comms.protocol import StationFrame, StationFrameKind
from volery.comms.station.statuses import mission_gist, slam_gist
from volery.core.clock import NS_PER_S
from volery.core.errors import CommsError
from volery.graph.messages import Point, message_type

Send = Callable[[StationFrameKind, int, bytes], int]

HELP = """\
list                            state of each UAV, with mission and SLAM if reported
take_off ADDRESS [ALTITUDE]     take off; altitude in m above its position
land ADDRESS                    land at its position
hold ADDRESS                    hold its position; a mission waits until resume
resume ADDRESS                  continue the mission
return ADDRESS                  return home and land; through its mission, else straight
go_to ADDRESS X Y Z [HEADING]   m in the map; degrees counterclockwise from its x axis
help                            show this help
quit                            leave the station

ADDRESS: a linear id such as 3, batch.plane such as 0.3, a name such as uav4, batch1, or all."""

_USAGE = {
    line.split()[0]: line.partition("  ")[0] for line in HELP.partition("\n\n")[0].splitlines()
}
_SIMPLE = {"land": "land", "hold": "hold", "return": "return_home", "resume": "resume"}
_TYPED = {"return_home": "return", "take_off_to": "take_off"}
"""Words of the command line for commands of another name."""
_FORMS = "a linear id such as 3, batch.plane such as 0.3, a name such as uav4, batch1, or all"

_MIN_GAP_RATIO = 0.5
"""Min ratio of the gaps at both ends; a smaller one is a backlog that arrives at once, or its
beginning.
"""
_LONGEST_KEPT_NS = 65 * NS_PER_S
"""Slightly longer than a server stores messages; an older one means that the clocks differ.
Modelling choices.
"""


class StationRow(NamedTuple):
    """One UAV, for a table."""

    name: str
    address: str
    mode: str
    position: str
    speed: str
    battery: str
    age: str
    mission: str = "-"
    """Phase and sector; `-`: no mission."""
    slam: str = "-"
    problem: str = ""


HEAD = (
    "UAV",
    "station",
    "mode",
    "position (m)",
    "speed (m/s)",
    "battery",
    "received (s ago)",
    "mission",
    "SLAM",
    "problem",
)


class GroundStation:
    """Stores the states of UAVs, and turns lines into commands.

    send: sends a message, as `Station.send`. group_size: as of the server. is_joined: whether
    a server is connected.
    """

    def __init__(
        self,
        send: Send,
        group_size: int = GROUP_SIZE,
        is_joined: Callable[[], bool] = lambda: True,
    ) -> None:
        self._send = send
        self._is_joined = is_joined
        self._planes = group_size
        self._states: dict[int, tuple[Any, int]] = {}
        self._fresh: dict[int, _ClockOffset] = {}
        self._missions: dict[int, Any] = {}
        self._slams: dict[int, str] = {}
        self._asked: dict[int, str] = {}

    def take(self, frame: StationFrame, now_ns: int) -> str | None:
        """Processes a message; returns a line to show, or None.

        now_ns: by a clock that never goes back, near the wall time that stations put on frames.
        """
        try:
            named = decode_named(frame.payload)
        except CommsError as error:
            return f"{self._name(frame.source)}: {error}"
        if named[:2] == (STATE, STATE_TYPE):
            before = self._states.get(frame.source)
            fresh = self._fresh.setdefault(frame.source, _ClockOffset())
            made_ns = fresh.made_ns(frame.time_ns, now_ns)
            self._states[frame.source] = named.message, made_ns
            mode = named.message.mode
            changed = before is None or before[0].mode != mode
            return f"{self._name(frame.source)}: {mode}" if changed else None
        if named[:2] == (MISSION, MISSION_TYPE):
            return self._take_mission(frame.source, named.message)
        if named[:2] == (SLAM, SLAM_TYPE):
            return self._take_slam(frame.source, slam_gist(named.message.data))
        if named[:2] == (REPLY, REPLY_TYPE):
            name, colon, text = named.message.data.partition(": ")
            return f"{self._name(frame.source)}: {_TYPED.get(name, name)}{colon}{text}"
        return f"{self._name(frame.source)}: {named.name} ({named.msgtype})"

    def _take_mission(self, source: int, status: Any) -> str | None:
        """Returns a line if phase, sector or problem have changed."""
        before, self._missions[source] = self._missions.get(source), status
        gist = mission_gist(status.phase, status.sector), status.problem
        if before and gist == (mission_gist(before.phase, before.sector), before.problem):
            return None
        return f"{self._name(source)}: mission {gist[0]}{', ' + gist[1] if gist[1] else ''}"

    def _take_slam(self, source: int, status: str) -> str | None:
        before, self._slams[source] = self._slams.get(source), status
        return None if status == before else f"{self._name(source)}: SLAM {status}"

    def refused(self, refusal: Refusal) -> str:
        """Returns a line about a refusal by the server."""
        asked = self._asked.get(refusal.sequence)
        return f"refused: {asked + ': ' if asked else ''}{refusal.text}"

    def rows(self, now_ns: int) -> list[StationRow]:
        """Returns a row for each UAV with a received state, by address."""
        return [
            self._row(address, state, now_ns - made_ns)
            for address, (state, made_ns) in sorted(self._states.items())
        ]

    def command(self, line: str) -> str:
        """Sends the command of a line; returns a confirmation. Raises CommsError if invalid."""
        word, *rest = line.split()
        fields: dict[str, Any] = {}
        if word in _SIMPLE and len(rest) == 1:
            name = _SIMPLE[word]
        elif word == "take_off" and len(rest) == 1:
            name = "take_off"
        elif word == "take_off" and len(rest) == 2:
            name, fields = "take_off_to", {"altitude": _number(rest[1])}
        elif word == "go_to" and len(rest) in (4, 5):
            name, fields = "go_to", _position_of(rest[1:])
        elif usage := _USAGE.get(_TYPED.get(word, word)):
            raise CommsError(f"'{line.strip()}': usage: {usage}")
        else:
            raise CommsError(f"'{line.strip()}' is not a command; help lists them")
        names = {state.name: address for address, (state, _) in self._states.items()}
        address = address_of(rest[0], self._planes, names)
        request = f"{COMMANDS[name]}_Request"
        message = message_type(request)(**fields)
        sequence = self._send(
            StationFrameKind.COMMAND, address, encode_named(name, request, message)
        )
        text = f"{word} to {rest[0]}"
        self._asked[sequence] = text
        anybody = is_station(address) or any(
            is_meant(each, address, self._planes) for each in self._states
        )
        note = "" if anybody else " (no state of such a UAV received so far)"
        if self._is_joined():
            return f"sent: {text}{note}"
        return f"queued: {text}{note}; sent when the server is back"

    def open_commands(self, is_settled: Callable[[int], bool]) -> list[str]:
        """Returns the commands that are not settled yet, oldest first."""
        return [text for sequence, text in self._asked.items() if not is_settled(sequence)]

    @property
    def has_received(self) -> bool:
        """Whether a UAV's state has been received."""
        return bool(self._states)

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

    def _row(self, address: int, state: Any, age_ns: int) -> StationRow:
        position, velocity = state.position, state.velocity
        mission = self._missions.get(address)
        speed = math.hypot(velocity.x, velocity.y, velocity.z)
        return StationRow(
            state.name,
            self._label(address),
            state.mode,
            f"{position.x:.1f} {position.y:.1f} {position.z:.1f}",
            f"{speed:.1f}",
            "-" if math.isnan(state.battery) else f"{100.0 * state.battery:.0f} %",
            f"{age_ns / NS_PER_S:.1f}",
            "-" if mission is None else mission_gist(mission.phase, mission.sector),
            self._slams.get(address, "-"),
            "" if mission is None else mission.problem,
        )


class _ClockOffset:
    """Clock offset of one source: gives the send time of a message by the receiver's clock.

    A frame holds its send time by its source's clock. The two clocks may differ, and messages that
    a server has stored arrive late, all at once. So a message counts as new if the gap to the
    previous one is about the same at both ends. A new message gives the offset of the clocks, which
    then gives the age of late ones. Before, both clocks are assumed to agree.
    """

    def __init__(self) -> None:
        self._before: tuple[int, int] | None = None
        """Send time of the latest message, by its source's clock, and its arrival."""
        self._offset_ns: int | None = None
        """Own clock minus the source's; None: unknown."""

    def made_ns(self, sent_ns: int, now_ns: int) -> int:
        """Returns the send time of a message that arrives now, by the own clock, at most now."""
        if self._before is not None:
            sent_gap_ns, gap_ns = sent_ns - self._before[0], now_ns - self._before[1]
            if 0 < _MIN_GAP_RATIO * sent_gap_ns <= gap_ns <= sent_gap_ns / _MIN_GAP_RATIO:
                self._offset_ns = now_ns - sent_ns
        self._before = sent_ns, now_ns
        if self._offset_ns is not None:
            return min(sent_ns + self._offset_ns, now_ns)
        return sent_ns if 0 <= now_ns - sent_ns <= _LONGEST_KEPT_NS else now_ns


def address_of(text: str, group_size: int, names: Mapping[str, int]) -> int:
    """Returns the address of a word; names: addresses by the names that stations report.

    `uavN`, if no station reports it, is the station with linear id N - 1. Raises CommsError if the
    word is no address.
    """
    if text == "all":
        return ALL
    if text in names:
        return names[text]
    if found := re.fullmatch(r"batch(\d{1,5})", text):
        return batch_address(int(found[1]))
    if found := re.fullmatch(r"(\d{1,5})\.(\d{1,5})", text):
        return Identity(int(found[1]), int(found[2])).address(group_size)
    if found := re.fullmatch(r"(uav)?(\d{1,5})", text):
        linear = int(found[2]) - bool(found[1])
        return Identity.of(linear, group_size).address(group_size)
    raise CommsError(f"'{text}' is not an address: write {_FORMS}")


def _position_of(words: list[str]) -> dict[str, Any]:
    heading = math.radians(_number(words[3])) if len(words) == 4 else 0.0
    x, y, z = map(_number, words[:3])
    return {"position": Point(x, y, z), "yaw": heading, "keep_heading": len(words) < 4}


def _number(word: str) -> float:
    try:
        value = float(word)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise CommsError(f"'{word}' is not a number")
    return value
