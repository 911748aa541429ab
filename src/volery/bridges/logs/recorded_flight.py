"""The flight in a log: which scenario was flown, and every command that came from outside."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from volery.bridges.logs.budgets import UnpackingBudget
from volery.bridges.logs.chunks import ChunkedLog, open_chunks
from volery.bridges.logs.decoding import LogDecoder
from volery.bridges.logs.records import LogRecord
from volery.core.errors import GraphError, RecordingError
from volery.graph import command_records
from volery.graph.session import ClientCommand

ORIGIN_TOPIC = "/volery/scenario"
_ORIGIN_TYPE = "std_msgs/msg/String"


@dataclass(frozen=True)
class RecordedScenario:
    """What was flown: a scenario's name and content, as plain data, its seed, Volery's version.

    A log says nothing of where the scenario's files lie: older logs have a `folder`, which is not
    believed, for a log may be another person's.
    """

    name: str
    seed: int
    version: str
    content: dict[str, Any]

    def to_json(self) -> str:
        """As it stands in a log."""
        fields = {"name": self.name, "seed": self.seed, "version": self.version, "folder": None}
        return json.dumps({**fields, "content": self.content}, default=str)  # of dates

    @classmethod
    def from_json(cls, text: str) -> RecordedScenario:
        """Read it. `RecordingError` for what is none."""
        try:
            plain = json.loads(text)
            name, version, content = str(plain["name"]), str(plain["version"]), plain["content"]
            return cls(name, int(plain["seed"]), version, dict(content))
        except (ValueError, TypeError, KeyError, RecursionError, OverflowError):
            reason = f"what the log tells on {ORIGIN_TOPIC} is no scenario: JSON with name, seed, "
            raise RecordingError(f"{reason}version and content is needed") from None


class RecordedCommand(NamedTuple):
    """A recorded command and its moment; see `engine.command_queue`."""

    number: int
    step: int
    turn: int
    taken: ClientCommand


@dataclass(frozen=True)
class RecordedFlight:
    """All that is needed to repeat a flight."""

    path: Path
    origin: RecordedScenario
    commands: tuple[RecordedCommand, ...]
    end_ns: int
    """Time of the log's last message."""


def origin_of(log: ChunkedLog) -> RecordedScenario | None:
    """The scenario of a log's flight; None where it does not tell.

    `RecordingError` where what it tells is none.
    """
    for record in _records_of(log, ORIGIN_TOPIC):
        if record.topic.msgtype == _ORIGIN_TYPE:
            return RecordedScenario.from_json(LogDecoder().decode(record).message.data)
    return None


def read_flight(path: Path) -> RecordedFlight:
    """Read the flight in a log. `RecordingError` where it is none that can be repeated."""
    log = open_chunks(path)
    try:
        origin = origin_of(log)
        if origin is None:
            raise RecordingError(f"{path}: tells of no scenario ({ORIGIN_TOPIC}) to be repeated")
        commands = _commands_of(log)
        last = log.content(log.chunks[-1]).heads
    except GraphError as error:
        raise RecordingError(f"{path}: {error}") from None
    finally:
        log.close()
    for place, command in enumerate(commands):
        if command.number != place:
            raise RecordingError(
                f"{path}: command {place} of the flight is missing, so that it cannot be repeated: "
                "the log is damaged, or was begun when very many had been given"
            )
    return RecordedFlight(path, origin, commands, last[-1].time_ns if last else 0)


def _commands_of(log: ChunkedLog) -> tuple[RecordedCommand, ...]:
    decoder = LogDecoder()
    commands: list[RecordedCommand] = []
    topics = {topic.topic for topic in log.topics.values()}
    waiting: Any = None
    """The record whose content is the next message."""
    for record in _records_of(log, command_records.TOPIC, following=True):
        if waiting is not None:
            if record.topic.topic == waiting.name:
                content = decoder.decode(record).message
                commands.append(_command(waiting, content))
            else:  # it was taken back before it was delivered, or the log ends
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
    # What was on its way when a log was begun is in it twice: as it came, and as an earlier one.
    once = {command.number: command for command in reversed(commands)}
    return tuple(once[number] for number in sorted(once))


def _command(message: Any, content: Any) -> RecordedCommand:
    m = message
    taken = ClientCommand(m.client, m.kind, m.name, m.type, content, m.latched, int(m.request))
    return RecordedCommand(int(m.number), int(m.step), int(m.turn), taken)


def _records_of(log: ChunkedLog, topic: str, *, following: bool = False) -> Iterator[LogRecord]:
    """Messages of a topic, and with `following` also the one after each, if its topic is known.

    `RecordingError` where the chunks that are said to hold them unpack to more than any log does.
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
