"""Whole flights: the modes, the services, the wood, the crash."""

import numpy as np
import pytest

from volery.control.flight_modes import FlightMode
from volery.engine.events import EventKind
from volery.graph.messages import Twist, Vector3


def test_take_off_go_land(simulate, flat_data):
    simulation = simulate(flat_data)
    uav = simulation.uavs["uav1"]
    uav.take_off(2.0)
    simulation.run(5.0)
    assert uav.mode is FlightMode.HOLD
    uav.go_to([5.0, 3.0, 3.0], yaw=1.0)
    simulation.run(8.0)
    np.testing.assert_allclose(uav.position_map, [5.0, 3.0, 3.0], atol=0.3)
    uav.land()
    simulation.run(10.0)
    assert uav.mode is FlightMode.LANDED
    kinds = [event.kind for event in simulation.diagnostics.events]
    assert EventKind.TOUCH_DOWN in kinds
    assert EventKind.IMPACT not in kinds
    assert not uav.crashed


def test_services_and_cmd_vel_fly_it_too(simulate, flat_data):
    simulation = simulate(flat_data)
    graph = simulation.graph
    assert graph.call("/uav1/take_off").success
    refused = graph.call("/uav1/take_off")
    assert not refused.success
    assert "cannot take off" in refused.message
    simulation.run(5.0)
    twist = graph.advertise("/uav1/cmd_vel", Twist)
    for _ in range(30):
        twist.publish(Twist(Vector3(2.0, 0.0, 0.0), Vector3(0.0, 0.0, 0.0)))
        simulation.run(0.1)
    uav = simulation.uavs["uav1"]
    assert uav.mode is FlightMode.VELOCITY
    assert uav.velocity_map[0] == pytest.approx(2.0, abs=0.3)
    twist.publish(Twist(Vector3(float("nan"), 0.0, 0.0), Vector3(0.0, 0.0, 0.0)))
    simulation.run(1.0)
    assert uav.mode is FlightMode.HOLD  # no command for half a second
    assert graph.call("/uav1/return_home").success
    simulation.run(30.0)
    assert uav.mode is FlightMode.LANDED
    assert np.hypot(*uav.position_map[:2]) < 0.5


@pytest.mark.parametrize("weather", [{}, {"rain_mm_h": 12.0, "fog_visibility_m": 300.0}])
def test_gap_following_crosses_a_wood_and_lands(simulate, wood_data, weather):
    wood_data["world"]["weather"] = weather
    wood_data["duration_s"] = 60.0
    wood_data["ends_when"] = "all_landed"
    simulation = simulate(wood_data, threads=2)
    simulation.run()
    assert simulation.clock.finished
    for event in simulation.diagnostics.events:
        assert event.kind not in {EventKind.COLLISION, EventKind.IMPACT}, event.describe()
    for uav in simulation.uavs.values():
        assert uav.mode is FlightMode.LANDED
        assert abs(uav.position_map[0] - 75.0) < 10.0


@pytest.mark.parametrize("on_contact", ["crash", "bounce"])
def test_flying_into_a_tree_at_speed(simulate, wood_data, on_contact):
    wood_data["physics"] = {"on_contact": on_contact}
    wood_data["types"]["surveyor"] = {"sensors": []}
    simulation = simulate(wood_data)
    uav = simulation.uavs["uav1"]
    state = simulation._engine.fleet.state
    # Straight at the thickest trunk, 25 m/s, from 10 m away.
    forest = simulation.world.forest
    trunk = forest.position_map[np.argmax(forest.dbh_m)]
    state.position_map[0] = trunk + np.array([-10.0, 0.0, 1.2])
    state.velocity_map[0] = [25.0, 0.0, 0.0]
    state.contact_budget[0] = 0.0
    uav.command_rotor_speeds(np.full(4, 770.0))
    simulation.run(0.6)
    hit = next(
        e
        for e in simulation.diagnostics.events
        if e.kind is EventKind.COLLISION and e.uav == "uav1"
    )
    assert hit.partner.startswith("tree")
    assert hit.speed_m_s > 5.0
    assert uav.position_map[0] < trunk[0] + 1.0 or abs(uav.position_map[1] - trunk[1]) > 0.3
    assert uav.crashed == (on_contact == "crash")
    simulation.run(8.0)
    if on_contact == "crash":
        assert np.linalg.norm(uav.velocity_map) < 0.1
        ground = float(simulation.world.terrain.height(*uav.position_map[:2]))
        assert ground - 0.05 < uav.position_map[2] < ground + 6.0


def test_two_uavs_that_meet_crash_into_each_other(simulate, flat_data):
    flat_data["types"]["f450"] = {}
    flat_data["uavs"] = [
        {"type": "f450", "position_m": [0.0, 0.0, 20.0]},
        {"type": "f450", "position_m": [6.0, 0.0, 20.0]},
    ]
    simulation = simulate(flat_data)
    state = simulation._engine.fleet.state
    state.velocity_map[:, 0] = [25.0, -25.0]
    for uav in simulation.uavs.values():
        uav.command_rotor_speeds(np.full(4, 770.0))
    simulation.run(0.5)
    hits = [e for e in simulation.diagnostics.events if e.kind is EventKind.COLLISION]
    assert {(e.uav, e.partner) for e in hits[:2]} == {("uav1", "uav2"), ("uav2", "uav1")}
    assert hits[0].speed_m_s == pytest.approx(50.0, abs=10.0)
    assert all(uav.crashed for uav in simulation.uavs.values())
    gap = np.linalg.norm(state.position_map[0] - state.position_map[1])
    assert state.position_map[0, 0] < state.position_map[1, 0], "they flew through each other"
    assert gap > 0.7
