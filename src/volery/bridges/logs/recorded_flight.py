"""The flight in a log: its scenario, and every command of external clients."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from volery.bridges.logs.budgets import UnpackingBudget
from volery.bridges.logs.chunks import ChunkedLog
from volery.bridges.logs.decoding import LogDecoder
from volery.bridges.logs.log_formats import open_chunks
from volery.bridges.logs.records import LogRecord
from volery.core.errors import GraphError, RecordingError
from volery.graph import command_records
from volery.graph.session import ClientCommand

ORIGIN_TOPIC = "/volery/scenario"
_ORIGIN_TYPE = "std_msgs/msg/String"


@dataclass(frozen=True)
class RecordedScenario:
    """A flight's scenario: name and content as plain data, seed, Volery's version.

    A log does not contain the folder of the scenario's files: the `folder` of older logs is
    ignored, because a log may be untrusted.
    """

    name: str
    seed: int
    version: str
    content: dict[str, Any]

    def to_json(self) -> str:
        """Returns the JSON text of a log."""
        fields = {"name": self.name, "seed": self.seed, "version": self.version, "folder": None}
        return json.dumps({**fields, "content": self.content}, default=str)  # dates

    @classmethod
    def from_json(cls, text: str) -> RecordedScenario:
        """Parses the JSON text of a log. Raises `RecordingError` if it is invalid."""
        try:
            plain = json.loads(text)
            name, version, content = str(plain["name"]), str(plain["version"]), plain["content"]
            return cls(name, int(plain["seed"]), version, dict(content))
        except (ValueError, TypeError, KeyError, RecursionError, OverflowError):
            reason = (
                f"the log's message on {ORIGIN_TOPIC} holds no scenario: JSON with name, seed, "
            )
            raise RecordingError(f"{reason}version and content is needed") from None


class RecordedCommand(NamedTuple):
    """A recorded command and its time; see `engine.command_queue`."""

    number: int
    step: int
    turn: int
    taken: ClientCommand


@dataclass(frozen=True)
class RecordedFlight:
    """All data that a replay of a flight needs."""

    path: Path
    origin: RecordedScenario
    commands: tuple[RecordedCommand, ...]
    end_ns: int
    """Time of the log's last message."""


def origin_of(log: ChunkedLog) -> RecordedScenario | None:
    """Returns the scenario of a log's flight; None if the log has none.

    Raises `RecordingError` if the scenario is invalid.
    """
    for record in _records_of(log, ORIGIN_TOPIC):
        if record.topic.msgtype == _ORIGIN_TYPE:
            return RecordedScenario.from_json(LogDecoder().decode(record).message.data)
    return None


def read_flight(path: Path) -> RecordedFlight:
    """Reads the flight in a log. Raises `RecordingError` if it cannot be replayed."""
    log = open_chunks(path)
    try:
        origin = origin_of(log)
        if origin is None:
            raise RecordingError(f"{path}: has no scenario ({ORIGIN_TOPIC}) to replay")
        commands = _commands_of(log)
        last = log.content(log.chunks[-1]).heads
    except GraphError as error:
        raise RecordingError(f"{path}: {error}") from None
    finally:
        log.close()
    for index, command in enumerate(commands):
        if command.number != index:
            raise RecordingError(
                f"{path}: command {index} is missing, so that the flight cannot be replayed: "
                "the log is damaged, or its recording started after very many commands"
            )
    return RecordedFlight(path, origin, commands, last[-1].time_ns if last else 0)


def _commands_of(log: ChunkedLog) -> tuple[RecordedCommand, ...]:
    decoder = LogDecoder()
    commands: list[RecordedCommand] = []
    topics = {topic.topic for topic in log.topics.values()}
    waiting: Any = None
    """Record whose content is the next message."""
    for record in _records_of(log, command_records.TOPIC, following=True):
        if waiting is not None:
            if record.topic.topic == waiting.name:
                content = decoder.decode(record).message
                commands.append(_command(waiting, content))
            else:  # withdrawn before its delivery, or the log ends
                commands.append(_command(waiting, None))
            waiting = None
        if record.topic.topic != command_records.TOPIC:
            continue
        message = decoder.decode(record).message
        if message.follows:
            if message.name not in topics:
                raise RecordingError(
                    f"{log.path}: lacks the messages of '{message.name}', which a command of the "
                    "flight published; record all topics"
                )
            waiting = message
        else:
            content = command_records.content_of(message.kind, message.type, message.cdr.tobytes())
            commands.append(_command(message, content))
    if waiting is not None:
        commands.append(_command(waiting, None))
    # Commands in transit at the start of a log are in it twice: as new and as earlier commands.
    once = {command.number: command for command in reversed(commands)}
    return tuple(once[number] for number in sorted(once))


def _command(message: Any, content: Any) -> RecordedCommand:
    m = message
    taken = ClientCommand(m.client, m.kind, m.name, m.type, content, m.latched, int(m.request))
    return RecordedCommand(int(m.number), int(m.step), int(m.turn), taken)


def _records_of(log: ChunkedLog, topic: str, *, following: bool = False) -> Iterator[LogRecord]:
    """Yields messages of a topic, with `following` also the one after each, if its topic is known.

    Raises `RecordingError` if their chunks unpack to more than the limits.
    """
    budget = UnpackingBudget(log.path, log.size)
    channels = {channel for channel, found in log.topics.items() if found.topic == topic}
    wanted = False
    for chunk in log.chunks:
        if not wanted and channels.isdisjoint(chunk.counts):
            continue
        content = log.content(chunk)
        budget.spend(len(content.data))
        for head in content.heads:
            if head.channel in channels or (wanted and head.channel in log.topics):
                yield log.record(content, head)
            wanted = following and head.channel in channels
