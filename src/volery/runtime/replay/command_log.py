"""Publishes client commands on `/volery/log` and stores them for logs that start later.

The simulation's thread processes all external input between two ticks, or during a barrier with
lock-step partners. It records each command with its time (`engine.command_queue`), at which
`runtime.replay.command_replay` repeats it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

from volery.core.errors import GraphError
from volery.engine.command_queue import CommandTime
from volery.engine.engine import Engine
from volery.graph import command_records as records
from volery.graph.graph import Graph
from volery.graph.messages import Published
from volery.graph.session import ClientCommand
from volery.graph.subscription_queue import array_bytes
from volery.runtime.replay.command_effects import CommandEffect, weight_of

MAX_STORED_BYTES = 32 * 1024 * 1024
"""Max size of the stored commands (modelling choice), bytes; beyond it all are discarded."""
_OVERHEAD_BYTES = 400
"""Memory of a stored command besides its content, bytes."""


class _StoredCommand(NamedTuple):
    number: int
    time_ns: int
    moment: CommandTime
    command: ClientCommand
    """The command, without its content if `cdr` holds that."""
    cdr: bytes | None


class CommandLog:
    """Records the commands of a simulation's gateway; see `graph.session`.

    refuse: returns why a command is refused at present; empty: accepted.
    """

    def __init__(
        self, graph: Graph, engine: Engine, refuse: Callable[[ClientCommand], str] | None = None
    ) -> None:
        self._graph = graph
        self._engine = engine
        self._refuse = refuse or _accept
        self._publisher = graph.advertise(records.TOPIC, records.TYPE)
        self._publisher.lasting = True
        self._stored: list[_StoredCommand] = []
        self._stored_bytes = 0
        self._has_overflowed = False
        self._next_number = 0
        self._ended = False
        self.has_changes = False
        """Whether a command has changed the results of the flight."""
        self.on_noted: Callable[[ClientCommand], None] = lambda _command: None
        """Receives each recorded command that is about to take effect."""
        self.repeats = False
        """Whether a replay is running: clients may observe, and change nothing."""

    def watch(self, command: ClientCommand) -> None:
        """Records a command. Raises `GraphError` if it is refused."""
        weight = weight_of(command)
        if self.repeats and weight is CommandEffect.CHANGES:
            raise GraphError("a recorded flight is repeated; nothing else may change it")
        if reason := self._refuse(command):
            raise GraphError(reason)
        if weight is not CommandEffect.QUERIES:
            self.note(command, weight)

    def note(self, command: ClientCommand, weight: CommandEffect) -> None:
        """Publishes and stores a command that is about to take effect."""
        stored = self._stamped(command)
        if self._publisher.has_subscribers:
            self._publisher.publish(_message(stored))
        self._store(stored)
        if weight is CommandEffect.CHANGES:
            self.has_changes = True
            self._engine.count_command()

    def end(self) -> None:
        """Records the end of the flight, once; calls no nodes, one of which may have ended it."""
        if not self._ended:
            self._ended = True
            stored = self._stamped(ClientCommand("", "end", "", ""))
            self._graph.publish_at_end(self._publisher, _message(stored))
            self._store(stored)

    def _stamped(self, command: ClientCommand) -> _StoredCommand:
        """Returns a command that is about to take effect, with its number and time."""
        cdr = None if records.is_large(command) else records.content_bytes(command)
        self.on_noted(command)
        number, moment = self._next_number, self._engine.moment
        self._next_number += 1
        return _StoredCommand(number, self._engine.time_ns, moment, command, cdr)

    def earlier(self) -> Iterator[Published]:
        """Yields the messages of all commands so far, for a log that starts now.

        If they exceeded the memory limit, it yields the last one alone, without its content: its
        number shows that others are missing.
        """
        for stored in self._stored:
            yield Published(records.TOPIC, records.TYPE, self._engine.time_ns, _whole(stored))

    def _store(self, stored: _StoredCommand) -> None:
        if self._has_overflowed:
            self._stored = [_bare(stored)]
            return
        if stored.cdr is None:
            size = array_bytes(stored.command.content)
        else:
            size = len(stored.cdr)
            stored = stored._replace(command=stored.command._replace(content=None))
        self._stored_bytes += size + _OVERHEAD_BYTES
        if self._stored and self._stored_bytes > MAX_STORED_BYTES:
            self._has_overflowed = True
            self._stored = [_bare(stored)]
        else:
            self._stored.append(stored)


def _accept(_command: ClientCommand) -> str:
    """Refuses nothing."""
    return ""


def _bare(stored: _StoredCommand) -> _StoredCommand:
    """Returns a command without its content."""
    return stored._replace(command=stored.command._replace(content=None), cdr=b"")


def _whole(stored: _StoredCommand) -> object:
    """Returns the message of a stored command with its content."""
    if stored.cdr is None:
        return _message(stored._replace(cdr=records.content_bytes(stored.command)))
    content = records.content_of(stored.command.kind, stored.command.type, stored.cdr)
    return _message(stored._replace(command=stored.command._replace(content=content)))


def _message(stored: _StoredCommand) -> object:
    return records.record_of(
        stored.command,
        stored.cdr,
        number=stored.number,
        time_ns=stored.time_ns,
        step=stored.moment.step,
        turn=stored.moment.turn,
    )
