"""Repeats a recorded flight: every client command, at the simulated time of the original.

    flight = read_flight(Path("flight.mcap"))
    with Simulation(scenario_of(flight.origin, load_scenario("mine.toml"))) as simulation:
        simulation.replay_commands(flight)
        simulation.run()

Pauses, speeds and single steps change no results and are not repeated; the flight runs at the
requested speed and ends where the recorded one did.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from volery.core.errors import CommandError
from volery.engine.command_queue import CommandTime
from volery.engine.engine import Engine
from volery.engine.pacing import Pacer
from volery.graph.session import Gateway
from volery.runtime.replay.command_log import CommandLog
from volery.runtime.replay.command_repeater import CommandRepeater

if TYPE_CHECKING:
    from volery.bridges.logs.recorded_flight import RecordedCommand, RecordedFlight


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
        self._repeater = CommandRepeater(gateway.graph, engine, pacer, log)
        self._next = 0
        self._end_step = -(-flight.end_ns // engine.dt_ns)
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
            if command.taken.kind == "end":
                self.over = True
            else:
                self._repeater.repeat(command.taken)
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
