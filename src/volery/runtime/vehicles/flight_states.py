"""Publishes `/uavN/flight_state` and serves `/uavN/get_vehicle_info`, for autopilots.

The state is the one that the controllers use: an estimate where the UAV flies on one. It is
published at a fixed rate if a node of the simulation subscribes, and only then recorded; without
one, only external clients receive it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from volery.control.flight_modes import FlightMode
from volery.engine.engine import Engine
from volery.graph.graph import Graph
from volery.graph.messages import Point, Pose, Quaternion, Vector3, header, message_type
from volery.graph.topics import Publisher
from volery.runtime.services.results import Close, Fields, offer_command
from volery.runtime.vehicles.uav import Uav
from volery.scenario.navigation import Origin
from volery.vehicle.airframe import GRAVITY

PERIOD_S = 0.01
"""Period, s: the rate of the fastest stream of PX4's onboard link (ATTITUDE, 100 Hz)."""
_TYPE = "volery_interfaces/msg/FlightState"
_BUILD = "volery_interfaces/srv/GetVehicleInfo"
_NO_BATTERY = (math.nan, math.nan, math.nan)
_MODES = tuple(FlightMode(k).name for k in range(len(FlightMode)))


class FlightStates:
    """Publishes the flight states of an engine's UAVs; `start` schedules them."""

    def __init__(self, graph: Graph, engine: Engine, origin: Origin) -> None:
        self._graph = graph
        self._engine = engine
        self._origin = origin
        self._publishers: dict[str, Publisher] = {}
        self._subscribed: list[tuple[int, Publisher]] = []
        self._seen: tuple[int, tuple[str, ...]] | None = None
        """Changes of the graph, and names of the UAVs, to which the list belongs."""

    def start(self, every: Callable[..., None]) -> None:
        """Publishes each `PERIOD_S` of simulated time from now on."""
        every(PERIOD_S, self._publish, wanted=lambda: bool(self._find_subscribed()))

    def open(self, uav: Uav) -> Iterator[Close]:
        """Adds a UAV; yields the functions that remove it."""
        publisher = self._graph.advertise(f"/{uav.name}/flight_state", _TYPE)
        self._publishers[uav.name] = publisher

        def close() -> None:
            self._publishers.pop(uav.name, None)
            publisher.cancel()

        yield close
        yield offer_command(
            self._graph, f"/{uav.name}/get_vehicle_info", _BUILD, lambda _request: self._build(uav)
        )

    def _find_subscribed(self) -> list[tuple[int, Publisher]]:
        """Returns the rows and publishers of UAVs whose topic has subscribers."""
        now = self._graph.changes, self._engine.names
        if self._seen is None or now[0] != self._seen[0] or now[1] is not self._seen[1]:
            self._seen = now
            found = [(k, self._publishers.get(name)) for k, name in enumerate(now[1])]
            self._subscribed = [(k, own) for k, own in found if own and own.subscriptions]
        return self._subscribed

    def _publish(self) -> None:
        subscribed = self._find_subscribed()
        for (_, publisher), message in zip(subscribed, self._messages(subscribed), strict=True):
            if publisher.has_internal_subscribers:
                publisher.publish(message)
            else:
                publisher.publish_external(message)

    def _messages(self, subscribed: list[tuple[int, Publisher]]) -> Iterator[Any]:
        engine = self._engine
        fleet, state = engine.fleet, engine.fleet.state
        rows = np.array([k for k, _ in subscribed], np.int64)
        motion, rates = fleet.believed(rows)
        in_air = (fleet.modes != FlightMode.LANDED) & ~state.on_ground & ~state.asleep
        battery = (state.battery_charge, state.battery_voltage, state.battery_current)
        batteries = np.stack([column[rows] for column in battery], axis=-1)
        columns = zip(
            rows.tolist(),
            fleet.modes[rows].tolist(),
            in_air[rows].tolist(),
            state.crashed[rows].tolist(),
            motion.position.tolist(),
            motion.attitude.tolist(),
            motion.velocity.tolist(),
            rates.tolist(),
            state.acceleration_map[rows].tolist(),
            batteries.tolist(),
            strict=True,
        )
        stamp = header(engine.time_ns, "map")
        state_type = message_type(_TYPE)
        for k, mode, airborne, crashed, position, q, v, w, a, power in columns:
            airframe = fleet.airframes[k]
            rotors = airframe.rotors
            fractions = state.rotor_speed[k, : len(rotors.places)] / rotors.max_speed_rad_s
            yield state_type(
                stamp,
                _MODES[mode],
                airborne,
                crashed,
                Pose(Point(*position), Quaternion(*q)),
                Vector3(*v),
                Vector3(*w),
                Vector3(*a),
                *(_NO_BATTERY if airframe.battery is None else power),
                fractions.astype(np.float32),
            )

    def _build(self, uav: Uav) -> Fields:
        airframe = uav.airframe
        limits, battery, origin = airframe.limits, airframe.battery, self._origin
        max_thrust = len(airframe.rotors.places) * airframe.max_rotor_thrust
        fields: dict[str, Any] = {
            "airframe": airframe.name,
            "rotors": len(airframe.rotors.places),
            "hover_thrust": airframe.body.mass_kg * GRAVITY / max_thrust,
            "speed": limits.speed_m_s,
            "climb": limits.climb_m_s,
            "descent": limits.descent_m_s,
            "tilt": math.radians(limits.tilt_deg),
            "battery_cells": 0 if battery is None else battery.cells,
            "battery_capacity": 0.0 if battery is None else battery.capacity_ah,
            "latitude": origin.latitude_deg,
            "longitude": origin.longitude_deg,
            "altitude": origin.altitude_m,
        }
        return fields
