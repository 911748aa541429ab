"""What clients do, told on `/volery/log` and kept for logs that are begun later.

Everything that comes from outside is taken by the simulation's thread between two ticks, or in a
meeting with lock-step partners. Each command is noted there with its moment
(`engine.command_queue`), at which `runtime.replay.command_replay` takes it again.
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

MOST_KEPT_BYTES = 32 * 1024 * 1024
"""Of commands that logs begun later are given (modelling choice); beyond that none are kept."""
_OVERHEAD_BYTES = 400
"""What a kept command needs besides its content."""


class _Kept(NamedTuple):
    number: int
    time_ns: int
    moment: CommandTime
    taken: ClientCommand
    """Without its content where `cdr` has that."""
    cdr: bytes | None


class CommandLog:
    """The watch of a simulation's gateway; see `graph.session`."""

    def __init__(self, graph: Graph, engine: Engine) -> None:
        self._graph = graph
        self._engine = engine
        self._publisher = graph.advertise(records.TOPIC, records.TYPE)
        self._publisher.lasting = True
        self._kept: list[_Kept] = []
        self._kept_bytes = 0
        self._has_lost_some = False
        self._next_number = 0
        self._ended = False
        self.repeats = False
        """Whether a recorded flight is repeated: clients may look on, and change nothing."""
        self.refuse: Callable[[ClientCommand], str] = _accept
        """Returns why a command is refused at present; empty: it is not."""

    def watch(self, taken: ClientCommand) -> None:
        """Note what a client does. `GraphError` where that must not be."""
        weight = weight_of(taken)
        if self.repeats and weight is CommandEffect.CHANGES:
            raise GraphError("a recorded flight is repeated; nothing else may change it")
        if reason := self.refuse(taken):
            raise GraphError(reason)
        if weight is not CommandEffect.ASKS:
            self.note(taken, weight)

    def note(self, taken: ClientCommand, weight: CommandEffect) -> None:
        """Tell of a command that is about to take effect."""
        cdr = None if records.is_large(taken) else records.content_bytes(taken)
        moment = self._engine.moment
        kept = _Kept(self._next_number, self._engine.time_ns, moment, taken, cdr)
        self._next_number += 1
        if self._publisher.wanted:
            self._publisher.publish(_message(kept))
        self._keep(kept)
        if weight is CommandEffect.CHANGES:
            self._engine.count_command()

    def end(self) -> None:
        """Tell that the flight is over; a second time nothing happens."""
        if not self._ended:
            self._ended = True
            self.note(ClientCommand("", "end", "", ""), CommandEffect.PACES)
            self._graph.deliver()

    def earlier(self) -> Iterator[Published]:
        """Messages of all commands so far, for a log that is begun now.

        Where they were too many to be kept, only the last one, without its content: by its number
        a reader sees that others are missing.
        """
        for kept in self._kept:
            yield Published(records.TOPIC, records.TYPE, self._engine.time_ns, _whole(kept))

    def _keep(self, kept: _Kept) -> None:
        if self._has_lost_some:
            self._kept = [_bare(kept)]
            return
        if kept.cdr is None:
            size = array_bytes(kept.taken.content)
        else:
            size = len(kept.cdr)
            kept = kept._replace(taken=kept.taken._replace(content=None))
        self._kept_bytes += size + _OVERHEAD_BYTES
        if self._kept and self._kept_bytes > MOST_KEPT_BYTES:
            self._has_lost_some = True
            self._kept = [_bare(kept)]
        else:
            self._kept.append(kept)


def _accept(_taken: ClientCommand) -> str:
    """Refuse nothing."""
    return ""


def _bare(kept: _Kept) -> _Kept:
    """A command without its content."""
    return kept._replace(taken=kept.taken._replace(content=None), cdr=b"")


def _whole(kept: _Kept) -> object:
    """The message of a kept command, its content in it."""
    if kept.cdr is None:
        return _message(kept._replace(cdr=records.content_bytes(kept.taken)))
    content = records.content_of(kept.taken.kind, kept.taken.type, kept.cdr)
    return _message(kept._replace(taken=kept.taken._replace(content=content)))


def _message(kept: _Kept) -> object:
    return records.record_of(
        kept.taken,
        kept.cdr,
        number=kept.number,
        time_ns=kept.time_ns,
        step=kept.moment.step,
        turn=kept.moment.turn,
    )
