"""Faults are listed while they are active, in Python and for clients, and after jumps of time."""

import json

from recorded_messages import Watcher
from service_calls import ask

MOTOR = {"kind": "motor", "uav": "uav1", "rotor": 1, "thrust_factor": 0.9}
IMU = {"kind": "sensor", "uav": "uav1", "sensor": "imu", "effect": "stuck"}


def listed(simulation):
    return [(fault.kind, fault.uav, fault.at_s) for fault in simulation.faults.active]


def test_faults_are_listed_from_their_beginning_to_their_end(simulate, flat_data):
    flat_data["uavs"][0] |= {"count": 2, "position_m": [0.0, 0.0, 5.0]}
    simulation = simulate(flat_data)
    inject, end = simulation.faults.inject, simulation.faults.end
    inject({**MOTOR, "at_s": 0.2, "until_s": 0.5})
    inject(IMU)
    inject({"kind": "gust", "velocity_m_s": [1.0, 0.0, 0.0]})
    assert listed(simulation) == []
    simulation.run(0.1)
    assert listed(simulation) == [("sensor", "uav1", 0.0)]
    simulation.run(0.2)
    assert listed(simulation) == [("sensor", "uav1", 0.0), ("motor", "uav1", 0.2)]
    snapshot = simulation.snapshot()
    simulation.run(0.3)
    assert listed(simulation) == [("sensor", "uav1", 0.0)]
    inject({**IMU, "effect": "dropped"})  # a sensor has one fault at a time
    simulation.run(0.1)
    assert [fault.effect for fault in simulation.faults.active] == ["dropped"]
    end(IMU)
    simulation.run(0.1)
    assert listed(simulation) == []
    simulation.restore(snapshot)
    assert listed(simulation) == [("sensor", "uav1", 0.0), ("motor", "uav1", 0.2)]
    simulation.vehicles.reset("uav1")
    assert listed(simulation) == []
    simulation.reset()
    assert listed(simulation) == []


def test_faults_alike_end_one_by_one_and_those_of_deleted_uavs_are_not_listed(simulate, flat_data):
    flat_data["uavs"][0] |= {"count": 2, "position_m": [0.0, 0.0, 5.0]}
    simulation = simulate(flat_data)
    simulation.faults.inject(MOTOR)
    simulation.faults.inject(MOTOR)
    simulation.faults.inject({**MOTOR, "uav": "uav2"})
    simulation.run(0.1)
    assert [uav for _, uav, _ in listed(simulation)] == ["uav1", "uav1", "uav2"]
    simulation.faults.end(MOTOR)
    simulation.run(0.1)
    assert [uav for _, uav, _ in listed(simulation)] == ["uav1", "uav2"]
    simulation.vehicles.delete("uav2")
    assert [uav for _, uav, _ in listed(simulation)] == ["uav1"]


def test_clients_receive_the_list_and_end_a_fault_with_what_they_received(simulate, flat_data):
    flat_data["uavs"][0]["position_m"] = [0.0, 0.0, 5.0]
    simulation = simulate(flat_data)
    watcher = Watcher(simulation, "/volery/faults")
    assert ask(simulation, "/volery/inject_fault", fault=json.dumps(MOTOR)).success
    simulation.run(1.5)
    (told,) = json.loads(watcher.last("/volery/faults").data)
    assert told == {**MOTOR, "at_s": told["at_s"]}
    assert ask(simulation, "/volery/end_fault", fault=json.dumps(told)).success
    simulation.run(1.5)
    assert json.loads(watcher.last("/volery/faults").data) == []
