"""The motion of UAVs as their odometry or estimator states it."""

from __future__ import annotations

import numpy as np

from volery.core import rotations
from volery.core.errors import ScenarioError, SensorError
from volery.runtime.vectorized_simulation import VectorizedSimulation
from volery.vehicle.fleet import FleetState

_SENSOR = "odom"


def estimated_state(envs: VectorizedSimulation, truth: FleetState) -> FleetState:
    """Returns `truth`, arrays (K, n, ...), with pose, velocity and rates from the sensor `odom`.

    Environments without a sample since their reset have the true ones. Raises `ScenarioError` for
    a UAV without that sensor.
    """
    position, attitude = truth.position_map.copy(), truth.attitude.copy()
    velocity, omega = truth.velocity_map.copy(), truth.omega_body.copy()
    for number, uav in enumerate(envs.uav_names):
        if _SENSOR not in envs.sensors[uav]:
            raise ScenarioError(
                f'{uav} has no sensor \'{_SENSOR}\': add one of kind "estimate" or "odometry" to '
                "the scenario's type, or observe the ground truth"
            )
        sensor = envs.sensors[uav][_SENSOR]
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
    return truth._replace(
        position_map=position,
        attitude=attitude,
        velocity_map=velocity,
        omega_body=np.asarray(omega),
    )
