"""The random streams of the sensors of environments, as arrays."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from volery.core.rng import stream_key
from volery.runtime.construction.sensor_suites import SensorInstance, stream_name
from volery.sensors.bank import Bank


class EnvironmentStreams:
    """Finds the streams of the sensors of a block's environments.

    fitted: F sensors of the UAVs of one environment. num_uavs: UAVs of an environment; row
    `env * num_uavs + uav` of the fleet is a UAV. seeds: those of the environments, which the block
    changes.
    """

    def __init__(
        self,
        fitted: Sequence[SensorInstance],
        num_uavs: int,
        banks: Sequence[Bank],
        seeds: Sequence[int],
    ) -> None:
        self._num_uavs = num_uavs
        self._seeds = seeds
        self._estimates = [sensor for sensor in fitted if sensor.id.name == "odom"]
        self._columns = {id(bank): _columns(fitted, num_uavs, bank) for bank in banks}
        self._names = [
            stream_name(sensor.spec.kind, sensor.id) if getattr(sensor.spec, "noise", False) else ""
            for sensor in fitted
        ]
        self._keys = np.zeros((len(seeds), len(fitted)), np.uint64)
        self.renew(np.arange(len(seeds)))

    def renew(self, envs: NDArray[np.int64]) -> None:
        """Computes the streams of the environments `envs` from their seeds."""
        seeds = [self._seeds[env] for env in envs.tolist()]
        for column, name in enumerate(self._names):
            if name:
                self._keys[envs, column] = [stream_key(seed, name) for seed in seeds]

    def of(self, bank: Bank, rows: NDArray[np.int64]) -> NDArray[np.uint64]:
        """Returns the streams (R,) of the sensors `rows` (R,) of a bank."""
        envs, columns = self._columns[id(bank)]
        keys: NDArray[np.uint64] = self._keys[envs[rows], columns[rows]]
        return keys

    def of_estimates(self, uavs: NDArray[np.int64]) -> Mapping[int, np.uint64]:
        """Returns the streams of the estimates of the UAVs `uavs`, by row of the fleet."""
        own = {
            sensor.id.uav: stream_name(sensor.spec.kind, sensor.id) for sensor in self._estimates
        }
        envs, indices = np.divmod(uavs, self._num_uavs)
        return {
            uav: stream_key(self._seeds[env], own[index])
            for uav, env, index in zip(uavs.tolist(), envs.tolist(), indices.tolist(), strict=True)
            if index in own
        }


def _columns(
    fitted: Sequence[SensorInstance], num_uavs: int, bank: Bank
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Returns environment and number among `fitted` of each sensor of a bank, (S,) each."""
    numbers = {(s.id.uav, s.id.name): number for number, s in enumerate(fitted)}
    uavs = np.array([sensor.uav for sensor in bank.sensors], np.int64)
    columns = [numbers.get((s.uav % num_uavs, s.name), 0) for s in bank.sensors]
    return uavs // num_uavs, np.array(columns, np.int64)
