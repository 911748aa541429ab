"""Adds autopilots to the UAVs of a scenario, or the sensors that external autopilots need."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from volery.mavlink.codec import dialect
from volery.mavlink.hil.ardupilot_json import STATE_HZ
from volery.scenario.load import parse_scenario
from volery.scenario.node_names import is_same_node
from volery.scenario.schema import Scenario

NODE = "mavlink_autopilot"
_CALIBRATED_IMU = "iim42653"


def with_autopilots(scenario: Scenario) -> Scenario:
    """Returns the scenario with an autopilot for each UAV whose type has none.

    The autopilots are then part of the scenario: logs contain them, and replayed flights have them
    too. Raises `BridgeError` if pymavlink is not installed.
    """
    dialect()
    data: dict[str, Any] = scenario.model_dump(exclude_unset=True)
    for name, uav_type in scenario.types.items():
        if not any(is_same_node(entry.node, NODE) for entry in uav_type.nodes):
            nodes = [entry.model_dump(exclude_unset=True) for entry in uav_type.nodes]
            data["types"][name] = {**data["types"][name], "nodes": [*nodes, {"node": NODE}]}
    return _parsed_like(scenario, data)


def with_px4(scenario: Scenario) -> Scenario:
    """Returns the scenario for real PX4s: all types have the sensors that PX4 needs.

    No UAV takes off by itself.

    Adds an IMU at 250 Hz, so that each step has a sample, and magnetometer, barometer and GNSS if a
    type has none. If the scenario chooses no IMU model, the model is a calibrated one: PX4 does not
    arm with a bias above 0.3 m/s^2.
    """
    dialect()
    others = ("magnetometer", "barometer", "gnss")
    return _with_sensors(scenario, {"imu": 250.0}, others, {"imu": _CALIBRATED_IMU})


def with_ardupilot(scenario: Scenario) -> Scenario:
    """Returns the scenario for real ArduPilots: IMU and true state at 800 Hz; no UAV takes off.

    If the physics step does not fit, it becomes the period of the states. ArduPilot computes all
    other sensors from the true state.
    """
    dialect()
    if scenario.physics.rate_hz % STATE_HZ:
        data: dict[str, Any] = scenario.model_dump(exclude_unset=True)
        data["physics"] = {**data.get("physics", {}), "rate_hz": STATE_HZ}
        scenario = _parsed_like(scenario, data)
    rate = float(STATE_HZ)
    return _with_sensors(scenario, {"imu": rate, "ground_truth": rate}, ("battery",))


def _with_sensors(
    scenario: Scenario,
    rates: Mapping[str, float],
    others: Sequence[str],
    models: Mapping[str, str] | None = None,
) -> Scenario:
    """Returns the scenario in which every type has these sensors; the UAVs wait on the ground.

    rates: sensor rates, Hz, by kind. models: for sensors whose model the scenario does not choose.
    """
    data: dict[str, Any] = scenario.model_dump(exclude_unset=True)
    for name, uav_type in scenario.types.items():
        sensors = [sensor.model_dump(exclude_unset=True) for sensor in uav_type.sensors]
        kinds = {sensor["kind"] for sensor in sensors}
        sensors += [{"kind": kind} for kind in (*rates, *others) if kind not in kinds]
        for sensor in sensors:
            if sensor["kind"] in rates:
                sensor["rate_hz"] = rates[sensor["kind"]]
            if models and sensor["kind"] in models:
                sensor.setdefault("model", models[sensor["kind"]])
        data["types"][name] = {**data["types"][name], "sensors": sensors}
    data["uavs"] = [{**group, "on_start": "wait"} for group in data["uavs"]]
    return _parsed_like(scenario, data)


def _parsed_like(scenario: Scenario, data: dict[str, Any]) -> Scenario:
    """Returns the scenario of `data`, with the access of `scenario`."""
    return parse_scenario(data, where=scenario.name, access=scenario.access)
