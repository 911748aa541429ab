"""State of the server: activity, current world, connected clients.

The owner, which builds and runs worlds, sets it through `PageServer`; the server's thread reads it.
"""

from __future__ import annotations

import asyncio
from contextlib import suppress
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import Protocol

from volery.bridges.rosbridge.fair_queue import FairQueue
from volery.bridges.rosbridge.message_encoder import MessageEncoder
from volery.bridges.rosbridge.protocol import ServerContext
from volery.bridges.rosbridge.rosapi import RosApi
from volery.bridges.rosbridge.tf_republisher import TfRepublisher
from volery.bridges.rosbridge.websocket_session import SERVICE_RESTART, WebSocketSession
from volery.graph.session import Gateway
from volery.runtime.construction.geometry import Geometry
from volery.runtime.vehicles.control_authority import ControlAuthority
from volery.scenario.catalog import ScenarioCatalog
from volery.scenario.schema import Scenario
from volery.server.operator_names import OperatorNames
from volery.server.tensorboard.process import TensorBoardProcess

_FAREWELL_S = 1.0
"""Time for a client to receive the close frame."""


class ServerActivity(StrEnum):
    """Activity of the server."""

    BUILDING = "building"
    FLYING = "flying"
    ENDED = "ended"
    """A simulation has reached the end of its scenario and waits."""
    NO_WORLD = "no_world"
    FAILED = "failed"
    """As NO_WORLD, because the scenario could not be built."""


@dataclass(frozen=True)
class ServerSituation:
    """Activity and texts that the status reports."""

    state: ServerActivity = ServerActivity.BUILDING
    scenario: str | None = None
    description: str = ""
    message: str = ""
    """Last error; empty: none."""


class World(Protocol):
    """A world that clients can join: a simulation, an idle server, a log."""

    @property
    def gateway(self) -> Gateway:
        """Joins clients to the graph."""

    @property
    def scenario(self) -> Scenario | None:
        """Scenario; None: no world, or a log of unknown origin."""

    @property
    def geometry(self) -> Geometry | None:
        """Present geometry; None: nothing to show."""

    @property
    def operators(self) -> ControlAuthority | None:
        """Operators in control of UAVs; None: there are no UAVs to control."""

    @property
    def waits_at_end(self) -> bool:
        """Whether a simulation stays paused at the end of its scenario."""


class JoinedWorld:
    """A world that clients have joined, and the state that its sessions share."""

    def __init__(self, world: World) -> None:
        now_ns = world.gateway.graph.now_ns
        self.gateway = world.gateway
        self.scenario = world.scenario
        self.operators = world.operators
        self.shared = ServerContext(MessageEncoder("ros2"), now_ns)
        self.queue = FairQueue()
        self._world = world
        self._rosapi = RosApi(world.gateway, "ros2", now_ns)
        self._rosapi.start()
        self._transforms = TfRepublisher(world.gateway)
        self._transforms.start()

    @property
    def geometry(self) -> Geometry | None:
        """Current geometry of the world; None: nothing to show."""
        return self._world.geometry

    @property
    def has_ended(self) -> bool:
        """Whether a simulation waits at the end of its scenario."""
        return self._world.waits_at_end

    def leave(self) -> None:
        """Stops the services for clients."""
        self._rosapi.stop()
        self._transforms.stop()


@dataclass(eq=False)
class Client:
    """One rosbridge client."""

    channel: WebSocketSession
    session_task: asyncio.Task[Exception | None]

    async def dismiss(self, reason: str) -> None:
        """Closes the connection with a request to reconnect; ignores an unresponsive client."""
        with suppress(Exception):
            async with asyncio.timeout(_FAREWELL_S):
                await self.channel.close(SERVICE_RESTART, reason)
        self.session_task.cancel()
        await asyncio.gather(self.session_task, return_exceptions=True)


@dataclass(eq=False)
class ServerState:
    """State that all requests share; only the server's thread changes it."""

    recordings: Path | None = None
    """Folder of logs; None: no recordings."""
    catalog: ScenarioCatalog = field(default_factory=ScenarioCatalog)
    """Scenarios that can be loaded; its folder is that of uploads."""
    unasked: bool = False
    """Whether no client has named the current scenario."""
    tensorboard: TensorBoardProcess | None = None
    """TensorBoard inside the page; None: there is none."""
    situation: ServerSituation = field(default_factory=ServerSituation)
    world: JoinedWorld | None = None
    clients: set[Client] = field(default_factory=set)
    operator_names: OperatorNames = field(default_factory=OperatorNames)

    async def join(self, world: World, situation: ServerSituation) -> None:
        """Connects clients to a world."""
        self.world, self.situation = JoinedWorld(world), situation

    async def leave(self, situation: ServerSituation) -> None:
        """Disconnects all clients from the present world."""
        world, self.world, self.situation = self.world, None, situation
        self.unasked = self.unasked and world is None  # a world ends when another one is asked for
        message = situation.message or "the world changes"
        await asyncio.gather(*(client.dismiss(message) for client in tuple(self.clients)))
        if world is not None:
            world.leave()
