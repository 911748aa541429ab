"""What the functions of a task see: the flights of all environments, as arrays."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Literal, cast

import numpy as np
from numpy.typing import NDArray

from volery.autonomy.policy import observation_terms
from volery.core import rotations
from volery.core.arrays import Array
from volery.core.clock import NS_PER_S
from volery.core.errors import ScenarioError, SensorError
from volery.learning.draws import Draws
from volery.runtime.environment_block import SampleArrays
from volery.runtime.vectorized_simulation import VectorizedSimulation
from volery.runtime.vehicles.batch_commands import PresentState
from volery.vehicle.fleet import FleetState

_ODOMETRY = "odom"
"""Sensor whose samples are the estimate of a UAV's motion."""


class Flight:
    """K environments of n UAVs at the present decision.

    Arrays must not be changed, apart from those in `values`.
    """

    def __init__(
        self, envs: VectorizedSimulation, action_size: int, decision_rate_hz: float
    ) -> None:
        self.envs = envs
        self.decision_rate_hz = decision_rate_hz
        self.num_envs = envs.num_envs
        self.num_uavs = len(envs.uav_names)
        self.airframe = envs.airframes[0]
        self.draws = Draws(self.num_envs)
        """Random numbers of the environments."""
        self.values: dict[str, Array] = {}
        """Arrays (K, ...) of the task by name, such as goals."""
        self.action: Array = np.zeros((self.num_envs, self.num_uavs, action_size))
        """(K, n, A) last actions."""
        self.previous_action: Array = np.zeros_like(self.action)
        """(K, n, A) actions before those."""
        self.decisions: NDArray[np.int64] = np.zeros(self.num_envs, np.int64)
        """(K,) decisions since the start of the episode."""
        self.parameters: dict[str, Array] = {}
        """Parameters (K,) of the present episodes, by name: those of the task or its curriculum."""
        self.varied: dict[str, Array] = {}
        """Numbers (K, n, size) that the task's randomization drew, by name."""
        self._state: PresentState | None = None
        self._estimate: FleetState | None = None
        self._is_estimated = False
        self._attitude_inverse: Array | None = None
        self._samples: dict[str, SampleArrays | None] = {}
        self._has_sample: dict[str, NDArray[np.bool_]] = {}

    def refresh(self) -> None:
        """Marks the state as changed."""
        if self._state is not None:
            self._state.expire()
        self._state = self._estimate = self._attitude_inverse = None
        self._samples.clear()
        self._has_sample.clear()

    @property
    def state(self) -> FleetState:
        """State of all UAVs, arrays (K, n, ...); see `FleetState` for units and frames.

        In observations of the source "estimate" pose, velocity and rates are the estimated ones.
        """
        if self._is_estimated:
            if self._estimate is None:
                self._estimate = _estimated_state(self.envs)
            return self._estimate
        if self._state is None:
            self._state = self.envs.present_state()
        return cast(FleetState, self._state)

    def seen_from(
        self, source: Literal["truth", "estimate"], function: Callable[[Flight], Array]
    ) -> Array:
        """Returns `function(self)` with `state` from ground truth or from the estimate."""
        if source == "truth":
            return function(self)
        self._is_estimated, self._attitude_inverse = True, None
        try:
            return function(self)
        finally:
            self._is_estimated, self._attitude_inverse = False, None

    def sample(self, sensor: str) -> SampleArrays | None:
        """Returns the last samples of a sensor of all UAVs, None before the first of all.

        Arrays are (K, n, ...), with the field names of `sensors.samples`: `sample["echoes"]`. Rows
        of UAVs without a sample in this episode, see `has_sample`, hold older ones.
        """
        if sensor not in self._samples:
            found = [self.envs.sample(uav, sensor) for uav in self.envs.uav_names]
            parts = [part for part in found if part is not None]
            self._samples[sensor] = _stacked(parts) if len(parts) == self.num_uavs else None
        return self._samples[sensor]

    def has_sample(self, sensor: str) -> NDArray[np.bool_]:
        """Returns whether each UAV has a sample of a sensor in this episode (K, n)."""
        if sensor not in self._has_sample:
            sensors = [self.envs.sensors[uav][sensor] for uav in self.envs.uav_names]
            self._has_sample[sensor] = np.stack([one.has_sample for one in sensors], axis=1)
        return self._has_sample[sensor]

    def sample_age_s(self, sensor: str) -> float:
        """Returns the time since the last measurement of a sensor, s; inf before the first.

        That of a LIDAR is its first beam, that of a camera the exposure of its first row.
        """
        stamp_ns = self.envs.sensors[self.envs.uav_names[0]][sensor].stamp_ns
        return math.inf if stamp_ns is None else (self.envs.time_ns - stamp_ns) / NS_PER_S

    def sensor_model(self, sensor: str) -> Any:
        """Returns the model of a LIDAR or camera. Raises `SensorError` before the first sample."""
        return self.envs.sensors[self.envs.uav_names[0]][sensor].model

    def to_body(self, vectors_map: Array) -> Array:
        """Returns vectors (K, n, 3) of the map frame in the body frames (FLU)."""
        if self._attitude_inverse is None:
            self._attitude_inverse = rotations.conjugate(self.state.attitude)
        return rotations.rotate(self._attitude_inverse, vectors_map)

    def to_heading(self, vectors_map: Array) -> Array:
        """Returns vectors (K, n, 3) of the map frame in the level heading frames."""
        return observation_terms.to_heading(self.state.attitude, vectors_map)


def _estimated_state(envs: VectorizedSimulation) -> FleetState:
    """Returns the state, arrays (K, n, ...), with pose, velocity and rates from the sensor `odom`.

    Environments without a sample since their reset have the true ones. Raises `ScenarioError` for
    a UAV without that sensor.
    """
    truth = envs.state()
    position, attitude = truth.position_map, truth.attitude
    velocity, omega = truth.velocity_map, truth.omega_body
    for number, uav in enumerate(envs.uav_names):
        if _ODOMETRY not in envs.sensors[uav]:
            raise ScenarioError(
                f'{uav} has no sensor \'{_ODOMETRY}\': add one of kind "estimate" or "odometry" to '
                "the scenario's type, or observe the ground truth"
            )
        sensor = envs.sensors[uav][_ODOMETRY]
        has = sensor.has_sample
        if not has.any():
            continue
        try:
            sample = sensor.latest
        except SensorError:
            continue
        position[has, number] = sample.position_odom[has]
        attitude[has, number] = sample.attitude[has]
        turned = rotations.rotate(sample.attitude[has], sample.velocity_body[has])
        velocity[has, number] = turned
        omega[has, number] = sample.omega_body[has]
    return truth


def _stacked(parts: list[SampleArrays]) -> SampleArrays:
    """Returns the samples of n UAVs, (K, ...) each, as arrays (K, n, ...)."""
    if len(parts) == 1:
        return {name: array[:, None] for name, array in parts[0].items()}
    return {name: np.stack([part[name] for part in parts], axis=1) for name in parts[0]}
