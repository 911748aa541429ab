"""The node `policy`: flies a trained policy on a graph, in simulation and in flight."""

from __future__ import annotations

import json
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from volery.autonomy.policy.action_commands import action_commands
from volery.autonomy.policy.observation_parts import (
    INPUTS,
    Histories,
    Observed,
    needed_inputs,
    observe,
)
from volery.autonomy.policy.policy_file import Policy
from volery.autonomy.policy.shipped_policies import load_policy
from volery.autonomy.status import publish_status
from volery.core.arrays import Array
from volery.core.errors import NodeError, VoleryError
from volery.core.saved_state import SavedAttributes
from volery.graph.codecs.zero import zero_message
from volery.graph.messages import Float32, String, message_type
from volery.graph.nodes.handles import NodePublisher
from volery.graph.nodes.node import Node


class Touchdown(SavedAttributes):
    """Watches `flight_state`; once the UAV was in the air and is down, calls the service `land`."""

    STATE: ClassVar[tuple[str, ...]] = ("is_down", "_was_airborne", "_is_airborne")

    def __init__(self, node: Node) -> None:
        self.is_down = False
        """Whether the UAV has touched down while the policy flew."""
        self._was_airborne = self._is_airborne = False
        self._land = node.create_client("std_srvs/srv/Trigger", "land")
        state = message_type("volery_interfaces/msg/FlightState")
        node.create_subscription(state, "flight_state", self._on_state, 5)

    def check(self, is_flying: bool) -> bool:
        """Returns `is_down`; at the touchdown of a flying policy, calls `land` once.

        A UAV that takes off again may be flown again.
        """
        if self.is_down and self._is_airborne:
            self.is_down = False
        elif is_flying and self._was_airborne and not self._is_airborne and not self.is_down:
            self.is_down, self._was_airborne = True, False
            if self._land.service_is_ready():
                self._land.call_async()
        return self.is_down

    def _on_state(self, message: Any) -> None:
        self._is_airborne = bool(message.airborne)
        self._was_airborne |= self._is_airborne


_DISABLED = "not enabled"
_NUMBERS = "std_msgs/msg/Float32MultiArray"


class PolicyNode(SavedAttributes, Node):
    """Flies by a trained policy: observes, computes the network, commands, at the policy's rate.

    Publishes `~/status` (JSON: state, reason, policy, task), `~/description` (the policy's, JSON),
    and at each decision `~/observation` and `~/action` (Float32MultiArray, as the network takes and
    returns them) and `~/value` (Float32, where the policy computes one). Without usable input the
    UAV stops: zero velocity, or the service `hold` for policies that command below velocities.

    Parameters
    ----------
    policy: a shipped policy's name, or a `.npz` file.
    goal: [x, y, z] in the map, m; empty: the node waits for a pose on `~/goal_pose`, or
        odometry of a moving goal on `~/goal_odometry`.
    max_goal_distance_m: farther goals count as this far, for policies that are trained with near
        ones; 0: as far as they are.
    timeout_s: age at which odometry and sensor data are too old.
    enabled: whether the policy flies.
    land_at_touchdown: whether the node calls the service `land` at the touchdown, and commands
        nothing until the UAV is in the air again; for policies that land.
    odometry: topic of the pose.
    neighbours: names of the other UAVs, for policies of teams.
    posts: vertical posts [x, y, radius] in the map, m, for policies that observe them.
    line: [x, y, yaw] of a straight course, for policies that follow one; `~/line_pose` replaces it.
    gates: gates [x, y, z, yaw] in the map, and a point to head for behind the last one, for
        policies that fly through gates; a path on `~/gates` replaces them.
    gate_opening_m: width of the gates' openings.

    `enabled` and `max_goal_distance_m` may be set in flight.

    """

    STATE: ClassVar[tuple[str, ...]] = (
        "_last_action",
        "_histories",
        "_last_status",
        "_has_flown",
        "_is_held",
    )

    def __init__(self, **options: Any) -> None:
        super().__init__("policy", **options)
        self._name = str(self.declare_parameter("policy", "homing").value)
        policy = self._load(self._name)
        self._description, self._network = policy.description, policy.network
        self._enabled = self.declare_parameter("enabled", True, read_only=False)
        self._max_goal_distance = self.declare_parameter(
            "max_goal_distance_m", 0.0, min_value=0.0, max_value=1e5, read_only=False
        )
        timeout_s = float(
            self.declare_parameter("timeout_s", 0.5, min_value=0.01, max_value=60.0).value
        )
        self._inputs = {
            name: INPUTS[name](self, timeout_s) for name in needed_inputs(self._description)
        }
        self._touchdown: Touchdown | None = None
        if self.declare_parameter("land_at_touchdown", False).value:
            self._touchdown = Touchdown(self)
        rate_hz = self._description.decision_rate_hz
        self._commands = action_commands(self._description.action, self, rate_hz)
        self._last_action = np.zeros(self._description.action.size)
        self._histories: Histories = {}
        self._has_flown = False
        """Whether the node has commanded an action since it is enabled."""
        self._is_held = False
        """Whether the UAV holds without further commands."""
        self._last_status = ""
        self._status = self.create_publisher(String, "~/status", 1, latched=True)
        described = self.create_publisher(String, "~/description", 1, latched=True)
        described.publish(String(json.dumps(self._description.to_json())))
        self._seen = self.create_publisher(message_type(_NUMBERS), "~/observation", 1)
        self._acted = self.create_publisher(message_type(_NUMBERS), "~/action", 1)
        self._valued = self.create_publisher(Float32, "~/value", 1)
        self.create_timer(1.0 / rate_hz, self._on_timer)

    def get_state(self) -> dict[str, Any]:
        """Returns the state for a snapshot."""
        inputs = {name: source.get_state() for name, source in self._inputs.items()}
        touchdown = None if self._touchdown is None else self._touchdown.get_state()
        return super().get_state() | {"inputs": inputs, "touchdown": touchdown}

    def set_state(self, state: dict[str, Any]) -> None:
        """Restores what `get_state` returned."""
        super().set_state(state)
        for name, source in self._inputs.items():
            source.set_state(state["inputs"][name])
        if self._touchdown is not None:
            self._touchdown.set_state(state["touchdown"])

    # ------------------------------------------------------------------------------------- inside

    def _load(self, name: str) -> Policy:
        try:
            return load_policy(str(self.find_file(name)) if name.endswith(".npz") else name)
        except VoleryError as error:
            raise NodeError(f"parameter policy: {error}") from None

    def _on_timer(self) -> None:
        if self._touchdown is not None and self._touchdown.check(self._has_flown):
            self._last_action, self._histories = np.zeros_like(self._last_action), {}
            self._publish_status("landed", "the UAV has touched down")
            return
        problem = self._problem()
        if problem:
            self._stop(problem)
            return
        seen = Observed(self._inputs, self._last_action, float(self._max_goal_distance.value))
        observation = observe(self._description.observation, seen, self._histories)
        if not np.isfinite(observation).all():
            self._stop("the observation is not finite")
            return
        output = self._network.evaluate(observation)
        if not np.isfinite(output.outputs).all():
            self._stop("the network's output is not finite")
            return
        self._last_action = output.action
        self._commands.send(output.action, seen.pose)
        self._has_flown, self._is_held = True, False
        self._publish_status("flying", "")
        _publish_numbers(self._seen, observation)
        _publish_numbers(self._acted, output.action)
        if self._network.has_value and self._valued.has_subscribers:
            self._valued.publish(Float32(float(output.value)))

    def _problem(self) -> str:
        """Returns why the policy cannot fly at present; empty: it can."""
        if not self._enabled.value:
            return _DISABLED
        now_ns = self.get_clock().now_ns()
        faults = (source.fault(now_ns) for source in self._inputs.values())
        return next((fault for fault in faults if fault), "")

    def _stop(self, reason: str) -> None:
        """Stops the UAV where the policy was flying it, and forgets the past decisions."""
        self._last_action, self._histories = np.zeros_like(self._last_action), {}
        if self._has_flown and not self._is_held:
            self._is_held = self._commands.hold()
        self._publish_status("holding" if self._has_flown else "waiting", reason)
        if reason == _DISABLED:
            self._has_flown = False

    def _publish_status(self, state: str, reason: str) -> None:
        status = {
            "state": state,
            "reason": reason,
            "policy": self._name,
            "task": self._description.task,
        }
        self._last_status = publish_status(self._status, status, self._last_status)


def _publish_numbers(publisher: NodePublisher, numbers: Array | NDArray[np.float32]) -> None:
    if publisher.has_subscribers:
        message = zero_message(_NUMBERS)
        message.data = np.asarray(numbers, np.float32)
        publisher.publish(message)
