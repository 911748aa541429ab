"""Repeats a recorded flight: every client command, at the simulated time of the original.

    flight = read_flight(Path("flight.mcap"))
    with Simulation(scenario_of(flight.origin, load_scenario("mine.toml"))) as simulation:
        simulation.replay_commands(flight)
        simulation.run()

Pauses, speeds and single steps change no results and are not repeated; the flight runs at the
requested speed and ends where the recorded one did.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any

from volery.bridges.logs.recorded_flight import RecordedCommand, RecordedFlight
from volery.core.errors import CommandError, GraphError
from volery.engine.command_queue import CommandTime
from volery.engine.engine import Engine
from volery.engine.pacing import Pacer
from volery.graph.graph import Graph
from volery.graph.service_reply import ServiceReply
from volery.graph.session import ClientCommand, Gateway
from volery.graph.topics import Publisher
from volery.runtime.replay.command_effects import CommandEffect, weight_of
from volery.runtime.replay.command_log import CommandLog
from volery.runtime.services.simulation_state import RunState

_SET_STATE = "simulation_interfaces/srv/SetSimulationState"


class CommandReplay:
    """Repeats the commands of a recorded flight; implements an engine's `Repeats`."""

    def __init__(
        self,
        flight: RecordedFlight,
        gateway: Gateway,
        engine: Engine,
        pacer: Pacer,
        log: CommandLog,
    ) -> None:
        self._commands: Sequence[RecordedCommand] = [
            command for command in flight.commands if command.taken.kind != "refused"
        ]  # refusals follow from the commands again
        self._engine = engine
        self._pacer = pacer
        self._log = log
        self._next = 0
        self._end_step = -(-flight.end_ns // engine.dt_ns)
        self._graph = gateway.graph
        self._clients = _Clients(gateway.graph)
        self._stopped = False
        self.over = False
        """Whether the replay has reached the end of the recorded flight."""
        if any(command.taken.name.startswith("/rosapi/") for command in self._commands):
            from volery.bridges.rosbridge.rosapi import RosApi

            RosApi(gateway, "ros2", gateway.graph.now_ns).start()

    def next_step(self) -> int | None:
        """Returns the physics step of the next command, or of the end; None afterwards."""
        if self._next < len(self._commands):
            return self._commands[self._next].step
        return None if self.over else max(self._end_step, self._engine.fleet.step)

    def take(self) -> bool:
        """Repeats the commands of the engine's present time; returns whether there were any.

        Raises `CommandError` if the engine is past the time of the next command: then the flight
        differs from the recorded one.
        """
        first = self._next
        while (command := self._due()) is not None:
            self._next += 1
            self._repeat(command.taken)
        ended = self._next == len(self._commands) and self._engine.fleet.step >= self._end_step
        self.over = self.over or ended
        return self._next > first

    def _due(self) -> RecordedCommand | None:
        if self._next == len(self._commands):
            return None
        command = self._commands[self._next]
        moment, here = CommandTime(command.step, command.turn), self._engine.moment
        if moment < here:
            raise CommandError(
                f"the flight is not the recorded one: command {command.number} "
                f"({command.taken.kind} {command.taken.name}) was taken at step {moment.step}, "
                f"turn {moment.turn}, and it is at step {here.step}, turn {here.turn} already"
            )
        return command if moment == here else None

    def _repeat(self, taken: ClientCommand) -> None:
        if taken.kind == "end":
            self.over = True
            return
        if self._is_left_out(taken):
            return
        self._log.note(taken, weight_of(taken))
        paused = self._pacer.paused
        # A command that failed or was refused here did so in the recorded flight too.
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
