"""Repeats commands of clients of another simulation: of a recorded one, or of a leader."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from typing import Any

from volery.core.errors import GraphError
from volery.engine.engine import Engine
from volery.engine.pacing import Pacer
from volery.graph.graph import Graph
from volery.graph.service_reply import ServiceReply
from volery.graph.session import ClientCommand
from volery.graph.topics import Publisher
from volery.runtime.replay.command_effects import CommandEffect, weight_of
from volery.runtime.replay.command_log import CommandLog
from volery.runtime.services.simulation_state import RunState

_SET_STATE = "simulation_interfaces/srv/SetSimulationState"


class CommandRepeater:
    """Repeats commands with all their effects but those on the pace."""

    def __init__(self, graph: Graph, engine: Engine, pacer: Pacer, log: CommandLog) -> None:
        self._graph = graph
        self._engine = engine
        self._pacer = pacer
        self._log = log
        self._clients = _Clients(graph)
        self._stopped = False

    def repeat(self, taken: ClientCommand) -> None:
        """Repeats a command; one that failed the first time fails again."""
        if self._is_left_out(taken):
            return
        self._log.note(taken, weight_of(taken))
        paused = self._pacer.paused
        with suppress(Exception), self._graph.on_behalf_of(taken.client):
            self._clients.do(taken)
        if self._pacer.paused and not paused:
            self._pacer.resume()

    def _is_left_out(self, taken: ClientCommand) -> bool:
        """Returns whether a command changed only the pace, or was refused because of it."""
        if taken.kind == "call" and taken.type == _SET_STATE:
            state = RunState.STOPPED if taken.content is None else taken.content.state.state
            again = self._stopped and self._engine.time_ns == 0
            self._stopped = state == RunState.STOPPED or (
                self._stopped and state != RunState.PLAYING
            )
            return again or state != RunState.STOPPED
        return taken.kind in ("call", "goal", "cancel") and weight_of(taken) is CommandEffect.PACES


class _Clients:
    """Repeats the actions of the clients of a recorded flight."""

    def __init__(self, graph: Graph) -> None:
        self._graph = graph
        self._publishers: dict[tuple[str, str], Publisher] = {}
        self._requests: dict[str, list[ServiceReply]] = {}
        self._deeds: dict[str, Callable[[ClientCommand], None]] = {
            "call": self._call,
            "publish": self._publish,
            "advertise": self._advertise,
            "unadvertise": self._unadvertise,
            "offer": self._offer,
            "withdraw": self._withdraw,
            "answer": lambda taken: self._request(taken).answer(taken.content),
            "failure": lambda taken: self._request(taken).fail(GraphError(taken.content or "")),
        }

    def do(self, taken: ClientCommand) -> None:
        """Repeats one command; raises whatever a service that it calls raises."""
        self._deeds[taken.kind](taken)

    def _call(self, taken: ClientCommand) -> None:
        self._graph.call_async(
            taken.name, taken.content, ServiceReply(_has_no_subscribers, _has_no_subscribers)
        )

    def _publish(self, taken: ClientCommand) -> None:
        key = taken.client, taken.name
        if key not in self._publishers:
            self._advertise(taken)
        if taken.content is not None:
            self._publishers[key].publish(taken.content)

    def _advertise(self, taken: ClientCommand) -> None:
        self._unadvertise(taken)
        self._publishers[taken.client, taken.name] = self._graph.advertise(
            taken.name, taken.type, latched=taken.latched
        )

    def _unadvertise(self, taken: ClientCommand) -> None:
        publisher = self._publishers.pop((taken.client, taken.name), None)
        if publisher is not None:
            publisher.cancel()

    def _offer(self, taken: ClientCommand) -> None:
        requests = self._requests[taken.name] = []

        def ask(_request: Any, reply: ServiceReply) -> None:
            requests.append(reply)

        self._graph.create_async_service(taken.name, taken.type, ask)

    def _withdraw(self, taken: ClientCommand) -> None:
        self._graph.destroy_service(taken.name)

    def _request(self, taken: ClientCommand) -> ServiceReply:
        return self._requests[taken.name][taken.request]


def _has_no_subscribers(_answer: object) -> None:
    """Discards the response: the client is not connected."""
