"""Faults are listed while they are active, in Python and for clients, and after jumps of time."""

import json

import pytest
from recorded_messages import ExternalSubscriber
from service_calls import call_service

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
    subscriber = ExternalSubscriber(simulation, "/volery/faults")
    assert call_service(simulation, "/volery/inject_fault", fault=json.dumps(MOTOR)).success
    simulation.run(1.5)
    (published,) = json.loads(subscriber.last("/volery/faults").data)
    assert published == {**MOTOR, "at_s": published["at_s"]}
    assert call_service(simulation, "/volery/end_fault", fault=json.dumps(published)).success
    simulation.run(1.5)
    assert json.loads(subscriber.last("/volery/faults").data) == []


GNSS = {"kind": "gnss_loss", "uav": "uav1"}
DROPPED = {**IMU, "effect": "dropped"}
SOUND = {"rotor": 1.0, "imu": True, "fix": True}


@pytest.fixture
def quick_fix(flat_data, tmp_path):
    """Hovers with an IMU, and a receiver that has a fix as soon as the signals are back."""
    model = tmp_path / "quick.toml"
    model.write_text('base = "gnss_m8"\nreacquisition_s = 0.0\n', encoding="utf-8")
    flat_data["types"]["f450"]["sensors"] = [
        {"kind": "imu"},
        {"kind": "gnss", "name": "gnss", "model": str(model)},
    ]
    flat_data["uavs"][0]["position_m"] = [0.0, 0.0, 30.0]
    return flat_data


def after(simulation):
    """What the rotor, the IMU and the receiver of uav1 do in the next half second."""
    sensors = simulation.uavs["uav1"].sensors
    start_s = simulation.time_s
    simulation.run(0.5)
    imu = sensors["imu"]
    return {
        "rotor": float(simulation._engine.fleet.state.rotor_health[0, 1]),
        "imu": imu.has_sample and imu.latest.stamp_s > start_s,
        "fix": sensors["gnss"].latest.has_fix,
    }


@pytest.mark.parametrize(
    ("fault", "effect"),
    [(MOTOR, {"rotor": 0.9}), (DROPPED, {"imu": False}), (GNSS, {"fix": False})],
)
@pytest.mark.parametrize("ended", ["by a client", "by a reset"])
def test_the_end_of_a_fault_that_ended_before_ends_no_later_one(
    simulate, quick_fix, fault, effect, ended
):
    """A first fault until 2 s is ended at 0.5 s; a second one from 1 s on is permanent."""
    simulation = simulate(quick_fix)
    simulation.faults.inject({**fault, "at_s": 0.1, "until_s": 2.0})
    simulation.run(0.5)
    if ended == "by a client":
        simulation.faults.end(fault)
    else:
        simulation.vehicles.reset("uav1")
    simulation.run(0.5)
    assert simulation.faults.active == ()
    simulation.faults.inject(fault)
    simulation.run(1.5)
    assert after(simulation) == {**SOUND, **effect}
    assert len(simulation.faults.active) == 1
    over = [event for event in simulation.diagnostics.events if "fault over" in event.detail]
    assert len(over) == (1 if ended == "by a client" else 0)


@pytest.mark.parametrize("first_ends_s", [1.0, 3.0])
def test_satellites_are_lost_until_the_last_of_several_faults_ends(
    simulate, quick_fix, first_ends_s
):
    simulation = simulate(quick_fix)
    simulation.faults.inject({**GNSS, "at_s": 0.2, "until_s": first_ends_s})
    simulation.faults.inject({**GNSS, "at_s": 0.6, "until_s": 2.0})
    fixes, listed = [], []
    for _ in range(8):
        simulation.run(0.5)
        fixes.append(simulation.uavs["uav1"].sensors["gnss"].latest.has_fix)
        listed.append(len(simulation.faults.active))
    lost_s = max(first_ends_s, 2.0)
    assert fixes == [0.5 * (k + 1) > lost_s for k in range(8)]
    ends = (first_ends_s, 2.0)
    assert listed == [
        sum(s <= 0.5 * (k + 1) < e for s, e in zip((0.2, 0.6), ends, strict=True)) for k in range(8)
    ]


def test_one_of_several_losses_is_ended_by_a_client(simulate, quick_fix):
    simulation = simulate(quick_fix)
    simulation.faults.inject(GNSS)
    simulation.faults.inject(GNSS)
    for fixed, listed in ((False, 2), (False, 1), (True, 0)):
        simulation.run(1.0)
        assert simulation.uavs["uav1"].sensors["gnss"].latest.has_fix == fixed
        assert len(simulation.faults.active) == listed
        simulation.faults.end(GNSS)


def test_faults_of_a_snapshot_end_at_their_time(simulate, quick_fix):
    simulation = simulate(quick_fix)
    simulation.faults.inject({**MOTOR, "at_s": 0.5, "until_s": 1.9})
    early = simulation.snapshot()
    simulation.run(1.0)
    late = simulation.snapshot()
    for snapshot, seconds in ((early, 1.0), (late, 0.2), (early, 0.7)):
        simulation.restore(snapshot)
        simulation.run(seconds)
        assert after(simulation)["rotor"] == 0.9
        simulation.run(1.0)
        assert after(simulation) == SOUND


def test_a_fault_planned_for_a_uav_that_is_of_another_type_by_then_does_no_harm(
    simulate, flat_data, caplog
):
    flat_data["uavs"][0] |= {"count": 2, "position_m": [0.0, 0.0, 5.0]}
    flat_data["faults"] = [{**IMU, "sensor": "range", "at_s": 0.3}, {**IMU, "at_s": 0.3}]
    simulation = simulate(flat_data)
    simulation.vehicles.delete("uav1")
    simulation.run(0.1)
    simulation.vehicles.spawn("uav1", "crazyflie", [0.0, 9.0, 5.0])
    simulation.run(0.3)
    assert "fault: sensor is not possible: uav1 has no sensor 'range'" in caplog.text
    assert listed(simulation) == [("sensor", "uav1", 0.3)]
