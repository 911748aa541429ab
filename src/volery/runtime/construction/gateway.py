"""Builds the gateway through which clients of other threads join a simulation's graph."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from volery.engine.engine import Engine
from volery.engine.lock_step import Partner
from volery.engine.pacing import Pacer
from volery.graph.graph import Graph
from volery.graph.rotor_layout import RotorLayout, RotorPosition
from volery.graph.session import Gateway
from volery.runtime.replay.command_log import CommandLog
from volery.runtime.vehicles.uav import Uav


def build_gateway(
    graph: Graph,
    engine: Engine,
    pacer: Pacer,
    commands: CommandLog,
    uavs: Mapping[str, Uav],
    partners: Sequence[Partner],
) -> Gateway:
    """Returns a gateway whose clients command the engine; lock-step partners have priority."""

    def is_busy() -> bool:
        return pacer.is_behind and not partners

    return Gateway(
        graph,
        engine.inbox.post,
        commands.watch,
        open_queue=lambda: engine.inbox.open_queue().post,
        is_busy=is_busy,
        is_late=lambda: pacer.speed is not None and is_busy(),
        rotor_layouts=lambda: _rotor_layouts(uavs),
        reduce_latency=pacer.use_low_latency,
    )


def _rotor_layouts(uavs: Mapping[str, Uav]) -> dict[str, RotorLayout]:
    """Returns the rotors of each UAV by its name; thread-safe."""
    return {
        name: [
            RotorPosition(rotor.position_m[0], rotor.position_m[1], rotor.direction)
            for rotor in uav.airframe.rotors.places
        ]
        for name, uav in dict(uavs).items()
    }
