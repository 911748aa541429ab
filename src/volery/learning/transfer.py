"""Flies a policy in the full simulation: with its node, an estimator, sensor noise and latency.

Episodes begin and end as those of the policy's task, judged by ground truth; the policy itself runs
in the node `policy` and sees what the UAV's sensors and estimator publish.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from volery.core import rotations
from volery.core.clock import ns_from_s
from volery.core.errors import ScenarioError
from volery.learning.course_messages import CourseMessages
from volery.learning.flight import Flight
from volery.learning.tags.full_simulation import add_tag, observes_tag, place_tag
from volery.learning.task import Task
from volery.runtime.simulation import Simulation
from volery.runtime.vectorized_simulation import VectorizedSimulation
from volery.runtime.vehicles.batch_commands import PresentState
from volery.scenario.load import parse_scenario
from volery.scenario.schema import Scenario
from volery.vehicle.airframe import Airframe

_SENSORS: tuple[dict[str, Any], ...] = (
    {"kind": "imu"},
    {"kind": "gnss", "model": "gnss_f9p_rtk", "rate_hz": 10.0},
    {"kind": "barometer"},
    {"kind": "magnetometer"},
)
"""RTK: with the drift of a receiver alone no policy, and no operator, could find goals that are
known by their coordinates to a fraction of a metre."""
_ESTIMATE_HZ = 100.0


@dataclass(frozen=True)
class TransferResult:
    """How often a policy succeeds in the full simulation."""

    episodes: int
    successes: int
    ends: dict[str, int]
    """Episodes by the termination that ended them; `time_limit` for the others."""

    @property
    def success(self) -> float:
        """Fraction of episodes that succeed."""
        return self.successes / self.episodes


def fly_transfer(
    policy: str | Path,
    task: Task,
    *,
    episodes: int = 50,
    seed: int = 1_000_000,
    latency_s: float = 0.02,
    on_episode: Callable[[int, bool], Any] | None = None,
) -> TransferResult:
    """Flies `episodes` of `task` by the node `policy` in the full simulation.

    policy: a shipped policy's name, or a `.npz` file. seed: of the first episode; each has its own,
    which training never uses. latency_s: computation latency of the node. on_episode: called with
    the number of episodes so far and whether the last one succeeded. Raises `ScenarioError` for a
    task of several UAVs. A task of several worlds is flown in its `unseen_worlds`, one after the
    other.
    """
    task = task.in_unseen_worlds()
    scenario = transfer_scenario(task, policy, latency_s)
    if len(scenario.uavs) != 1 or task.num_agents != 1:
        raise ScenarioError(f"task '{task.name}': transfer is measured with tasks of one UAV")
    ends: dict[str, int] = {}
    successes = 0
    with ExitStack() as stack:
        found: tuple[int | None, _Episode] | None = None
        for number in range(episodes):
            world = task.worlds[number % len(task.worlds)] if task.worlds else None
            if found is None or found[0] != world:
                stack.close()
                found = world, stack.enter_context(_episode_in(scenario, world, task))
            name, is_success = found[1].fly(seed + number)
            ends[name] = ends.get(name, 0) + 1
            successes += is_success
            if on_episode is not None:
                on_episode(number + 1, is_success)
    return TransferResult(episodes, successes, ends)


@contextmanager
def _episode_in(scenario: Scenario, world: int | None, task: Task) -> Iterator[_Episode]:
    """Makes a simulation in the world of a seed; None: in that of the scenario."""
    own = scenario if world is None else scenario.with_(world={"seed": world})
    with closing(Simulation(own, threads=1)) as simulation:
        yield _Episode(simulation, task)


def transfer_scenario(task: Task, policy: str | Path, latency_s: float = 0.02) -> Scenario:
    """Returns the task's scenario with an estimator, its sensors, and the node `policy`."""
    scenario = task.scenario()
    data = scenario.model_dump(mode="json", exclude_unset=True)
    kind = scenario.uavs[0].type
    sensors = [
        sensor
        for sensor in data["types"][kind].get("sensors", [])
        if sensor["kind"] not in ("odometry", "estimate")
    ]
    present = {sensor["kind"] for sensor in sensors}
    sensors += [sensor for sensor in _SENSORS if sensor["kind"] not in present]
    sensors.append({"kind": "estimate", "rate_hz": _ESTIMATE_HZ})
    name = str(policy)
    if name.endswith(".npz"):
        name = str(Path(name).resolve())
    node = {"node": "policy", "latency_s": latency_s, "parameters": {"policy": name}}
    data["types"][kind] |= {"sensors": sensors, "nodes": [node]}
    if observes_tag(task):
        add_tag(data, kind, latency_s)
    data["duration_s"] = max(task.episode_s * 2.0, 1.0)
    return parse_scenario(data)


class _OneEnvironment:
    """What functions of tasks use of a `VectorizedSimulation`, of one simulation."""

    num_envs = 1

    def __init__(self, simulation: Simulation) -> None:
        self._simulation = simulation
        self.uav_names = simulation.vehicles.names
        self.dt_ns = ns_from_s(1.0 / simulation.scenario.physics.rate_hz)

    @property
    def airframes(self) -> tuple[Airframe, ...]:
        return tuple(uav.airframe for uav in self._simulation.uavs.values())

    def present_state(self) -> PresentState:
        state = self._simulation.vehicles.state()
        return PresentState([state], (1, len(self.uav_names)))


class _Episode:
    def __init__(self, simulation: Simulation, task: Task) -> None:
        self._simulation, self._task = simulation, task
        envs = cast("VectorizedSimulation", _OneEnvironment(simulation))
        self._flight = Flight(envs, task.action.size, task.decision_rate_hz)
        for name, own in task.values.items():
            self._flight.values[name] = np.zeros((1, *own))
        for name, number in task.parameters.items():
            self._flight.parameters[name] = np.full(1, number)
        self._uav = simulation.vehicles.names[0]
        self._messages = CourseMessages(simulation, task)
        self._steps = round(simulation.scenario.physics.rate_hz / task.decision_rate_hz)

    def fly(self, seed: int) -> tuple[str, bool]:
        """Flies an episode; returns the name of its end and whether it succeeds."""
        simulation, task, flight = self._simulation, self._task, self._flight
        simulation.reset(seed)
        self._begin(seed)
        for decision in range(task.episode_decisions):
            self._messages.publish_goal(flight)
            simulation.step(self._steps)
            flight.refresh()
            flight.decisions[:] = decision + 1
            if task.advance is not None:
                task.advance(flight)
            for end in task.terminations:
                if np.asarray(end.function(flight)).any():
                    return end.name, end.is_success
        return "time_limit", task.success is not None and bool(task.success(flight)[0])

    def _begin(self, seed: int) -> None:
        flight, simulation = self._flight, self._simulation
        env: NDArray[np.int64] = np.zeros(1, np.int64)
        flight.draws.seed(env, np.array([seed]))
        flight.draws.episode_seeds(env)
        start = self._task.begin(flight, env)
        flight.decisions[:] = 0
        if observes_tag(self._task):
            place_tag(simulation, flight)
        if start is not None:
            motion = start.spread(1, 1)
            omega_map = rotations.rotate(motion.attitude[0], motion.omega_body[0])
            # in this order: the estimate restarts with the pose, from the true motion
            simulation.vehicles.set_velocity(self._uav, motion.velocity_map[0], omega_map)
            simulation.vehicles.set_pose(self._uav, motion.position_map[0], motion.attitude[0])
            simulation.vehicles.set_velocity(self._uav, motion.velocity_map[0], omega_map)
        flight.refresh()
        self._messages.begin(flight)
