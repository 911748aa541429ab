"""Publishes all monitoring topics from the thread that runs the simulation.

True poses (`/ground_truth/tf`) and active faults (`/volery/faults`) are here, others beside it.
"""

from __future__ import annotations

import json
import time
from typing import Any

import numpy as np

from volery.engine.engine import Engine
from volery.engine.faults import FaultPlan
from volery.graph.graph import Graph
from volery.graph.messages import TFMessage, message_type
from volery.graph.session import Gateway
from volery.publishing.transforms import transforms_in_map
from volery.runtime.monitoring.live_topic import LiveTopic
from volery.runtime.monitoring.status import Status, StatusSources
from volery.runtime.monitoring.vehicles import VehicleTopic
from volery.runtime.vehicles.control_authority import ControlAuthority
from volery.runtime.vehicles.manager import VehicleManager

_CLOCK_PERIOD_S = 0.01
_DIGEST_PERIOD_S = 0.01

_POSES = "/ground_truth/tf"
_POSES_PERIOD_S = 0.02
_POSES_MIN_PERIOD_S = 0.05
"""Min wall time between two external messages, s: smooth at a twentieth of real time."""

_FAULTS = "/volery/faults"
_FAULTS_TYPE = "std_msgs/msg/String"
_FAULTS_PERIOD_S = 1.0
_FAULTS_MIN_PERIOD_S = 0.1


class Monitor:
    """Publishes clock, poses, vehicles and run state; changes nothing in the simulation."""

    def __init__(
        self,
        manager: VehicleManager,
        gateway: Gateway,
        operators: ControlAuthority,
        sources: StatusSources,
    ) -> None:
        self._graph = gateway.graph
        engine, publisher, outlet = manager.engine, manager.publisher, manager.outlet
        vehicles = VehicleTopic(engine, manager.uavs, gateway, operators.operator_of)
        self._present = (
            _poses_topic(gateway.graph, engine),
            vehicles.present,
            _faults_topic(gateway.graph, manager.faults),
        )
        self._status = Status(manager.scenario, engine, gateway, sources)
        engine.every(
            _CLOCK_PERIOD_S,
            lambda: publisher.publish_clock(engine.time_ns),
            wanted=lambda: publisher.clock_wanted,
        )
        engine.every(
            _DIGEST_PERIOD_S, outlet.take_fingerprint, wanted=lambda: outlet.digest is not None
        )
        for present in self._present:
            present.begin(engine.every)

    def look(self) -> None:
        """Publishes changes to external clients; call it between ticks, at any rate."""
        now_s = time.perf_counter()
        for present in self._present:
            present.look(now_s)
        self._status.look(now_s)

    def jumped(self) -> None:
        """Publishes everything again after another state, or the start, was restored."""
        self._graph.republish_latched()
        self._status.jumped()
        self.look()


def _poses_topic(graph: Graph, engine: Engine) -> LiveTopic:
    """Publishes `map -> uavN/base_link` of every UAV in order, then `map -> NAME` of actors.

    These are the true poses, for pages and renderers. Autonomy must not subscribe: a real robot has
    no such topic.
    """
    return LiveTopic(
        graph.advertise(_POSES, TFMessage),
        lambda: _poses_message(engine),
        lambda: _poses_content(engine),
        _POSES_PERIOD_S,
        _POSES_MIN_PERIOD_S,
    )


def _poses_message(engine: Engine) -> TFMessage:
    state, actors = engine.fleet.state, engine.actors
    frames = [f"{name}/base_link" for name in engine.names]
    poses = np.hstack([state.position_map, state.attitude])
    if actors is not None:
        frames += actors.names
        poses = np.vstack([poses, actors.poses_at(engine.time_ns)])
    return transforms_in_map(engine.time_ns, frames, poses)


def _poses_content(engine: Engine) -> tuple[Any, ...]:
    state, actors = engine.fleet.state, engine.actors
    moving = b"" if actors is None else actors.poses_at(engine.time_ns).tobytes()
    return (
        engine.time_ns,
        engine.names,
        state.position_map.tobytes(),
        state.attitude.tobytes(),
        moving,
    )


def _faults_topic(graph: Graph, plan: FaultPlan) -> LiveTopic:
    """Returns the topic of the faults that have begun and not ended, a list of tables in JSON.

    Each table is as in a scenario and in `/volery/inject_fault`; `at_s` is when the fault began.
    """

    def message() -> Any:
        active = [fault.model_dump(mode="json", exclude_none=True) for fault in plan.active]
        return message_type(_FAULTS_TYPE)(json.dumps(active))

    return LiveTopic(
        graph.advertise(_FAULTS, _FAULTS_TYPE),
        message,
        lambda: plan.active,
        _FAULTS_PERIOD_S,
        _FAULTS_MIN_PERIOD_S,
    )
