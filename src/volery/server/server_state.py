"""What the server knows of the run: its state, its world, and who is connected.

Its owner, who builds and flies, tells through `PageServer`; the server's own thread reads.
"""

from __future__ import annotations

import asyncio
from contextlib import suppress
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import Protocol

from volery.bridges.rosbridge.bulk_turns import BulkTurns
from volery.bridges.rosbridge.message_encoder import MessageEncoder
from volery.bridges.rosbridge.protocol import ServerContext
from volery.bridges.rosbridge.rosapi import RosApi
from volery.bridges.rosbridge.tf_republisher import TfRepublisher
from volery.bridges.rosbridge.websocket_session import SERVICE_RESTART, WebSocketSession
from volery.graph.graph import Graph
from volery.graph.session import Gateway
from volery.runtime.build.geometry import Geometry
from volery.runtime.end_of_run import EndOfRun
from volery.runtime.vehicles.control_authority import ControlAuthority
from volery.scenario.catalog import ScenarioCatalog
from volery.scenario.schema import Scenario
from volery.server.operator_names import OperatorNames

_FAREWELL_S = 1.0
"""Time for a client to take the news that its world is gone."""


class ServerActivity(StrEnum):
    """What goes on."""

    BUILDING = "building"
    FLYING = "flying"
    ENDED = "ended"
    """A simulation waits at the end of its scenario."""
    NO_WORLD = "no_world"
    FAILED = "failed"
    """No world, because the scenario could not be built."""


@dataclass(frozen=True)
class ServerSituation:
    """The present state, in words."""

    state: ServerActivity = ServerActivity.BUILDING
    scenario: str | None = None
    description: str = ""
    message: str = ""
    """What went wrong, if something did."""


class World(Protocol):
    """What clients can join: a simulation, an idle server, a recording.

    Where it has a `scenario`, `geometry` and `operators`, as a `Simulation` has, they are served
    too. Where it has no scenario but a `name`, as a log of unknown origin has, that is told.
    """

    graph: Graph
    gateway: Gateway

    def use_low_latency(self) -> None:
        """Answer clients soon."""


class JoinedWorld:
    """A world that clients have joined: what their conversations have in common."""

    def __init__(self, world: World) -> None:
        graph = world.graph
        self.gateway = world.gateway
        self.scenario: Scenario | None = getattr(world, "scenario", None)
        self.operators: ControlAuthority | None = getattr(world, "operators", None)
        self.shared = ServerContext(MessageEncoder("ros2"), graph.now_ns)
        self.bulk = BulkTurns()
        self._world = world
        self._rosapi = RosApi(world.gateway, "ros2", graph.now_ns)
        self._rosapi.start()
        self._transforms = TfRepublisher(world.gateway)
        self._transforms.start()

    @property
    def geometry(self) -> Geometry | None:
        """What stands there at present; None: nothing that could be shown."""
        geometry: Geometry | None = getattr(self._world, "geometry", None)
        return geometry

    @property
    def has_ended(self) -> bool:
        """Whether a simulation waits at the end of its scenario."""
        end: EndOfRun | None = getattr(self._world, "end", None)
        return end is not None and end.waits

    def leave(self) -> None:
        """Take back what is offered to clients."""
        self._rosapi.stop()
        self._transforms.stop()


@dataclass(eq=False)
class Client:
    """One rosbridge client."""

    channel: WebSocketSession
    conversation: asyncio.Task[Exception | None]

    async def dismiss(self, reason: str) -> None:
        """Have it connect again, to another world; who does not listen is left alone."""
        with suppress(Exception):
            async with asyncio.timeout(_FAREWELL_S):
                await self.channel.close(SERVICE_RESTART, reason)
        self.conversation.cancel()
        await asyncio.gather(self.conversation, return_exceptions=True)


@dataclass(eq=False)
class ServerState:
    """What all requests share. Written to in the server's thread only."""

    recordings: Path | None = None
    """Folder of logs; None: there is none."""
    shelf: ScenarioCatalog = field(default_factory=ScenarioCatalog)
    """Scenarios that can be loaded; its folder is that of uploads."""
    situation: ServerSituation = field(default_factory=ServerSituation)
    world: JoinedWorld | None = None
    clients: set[Client] = field(default_factory=set)
    crew: OperatorNames = field(default_factory=OperatorNames)

    async def join(self, world: World, situation: ServerSituation) -> None:
        """Let clients into a world."""
        self.world, self.situation = JoinedWorld(world), situation

    async def leave(self, situation: ServerSituation) -> None:
        """Send everybody out of the present world."""
        world, self.world, self.situation = self.world, None, situation
        farewell = situation.message or "the world changes"
        await asyncio.gather(*(client.dismiss(farewell) for client in tuple(self.clients)))
        if world is not None:
            world.leave()
