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

    def repeat(self, command: ClientCommand) -> None:
        """Repeats a command; one that failed the first time fails again."""
        if self._is_left_out(command):
            return
        self._log.note(command, weight_of(command))
        paused = self._pacer.paused
        with suppress(Exception), self._graph.on_behalf_of(command.client):
            self._clients.do(command)
        if self._pacer.paused and not paused:
            self._pacer.resume()

    def _is_left_out(self, command: ClientCommand) -> bool:
        """Returns whether a command changed only the pace, or was refused because of it."""
        if command.kind == "call" and command.type == _SET_STATE:
            state = RunState.STOPPED if command.content is None else command.content.state.state
            again = self._stopped and self._engine.time_ns == 0
            self._stopped = state == RunState.STOPPED or (
                self._stopped and state != RunState.PLAYING
            )
            return again or state != RunState.STOPPED
        return (
            command.kind in ("call", "goal", "cancel") and weight_of(command) is CommandEffect.PACES
        )


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
            "answer": lambda command: self._request(command).answer(command.content),
            "failure": lambda command: self._request(command).fail(
                GraphError(command.content or "")
            ),
        }

    def do(self, command: ClientCommand) -> None:
        """Repeats one command; raises whatever a service that it calls raises."""
        self._deeds[command.kind](command)

    def _call(self, command: ClientCommand) -> None:
        self._graph.call_async(
            command.name, command.content, ServiceReply(_has_no_subscribers, _has_no_subscribers)
        )

    def _publish(self, command: ClientCommand) -> None:
        key = command.client, command.name
        if key not in self._publishers:
            self._advertise(command)
        if command.content is not None:
            self._publishers[key].publish(command.content)

    def _advertise(self, command: ClientCommand) -> None:
        self._unadvertise(command)
        self._publishers[command.client, command.name] = self._graph.advertise(
            command.name, command.type, latched=command.latched
        )

    def _unadvertise(self, command: ClientCommand) -> None:
        publisher = self._publishers.pop((command.client, command.name), None)
        if publisher is not None:
            publisher.cancel()

    def _offer(self, command: ClientCommand) -> None:
        requests = self._requests[command.name] = []

        def receive(_request: Any, reply: ServiceReply) -> None:
            requests.append(reply)

        self._graph.create_async_service(command.name, command.type, receive)

    def _withdraw(self, command: ClientCommand) -> None:
        self._graph.destroy_service(command.name)

    def _request(self, command: ClientCommand) -> ServiceReply:
        return self._requests[command.name][command.request]


def _has_no_subscribers(_answer: object) -> None:
    """Discards the response: the client is not connected."""
