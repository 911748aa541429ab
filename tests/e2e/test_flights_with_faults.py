"""Faults, as timed entries of a scenario and as calls."""

import numpy as np
import pytest

from volery.core.errors import CommandError, ScenarioError


@pytest.fixture
def airborne(flat_data):
    flat_data["uavs"][0]["position_m"] = [0.0, 0.0, 20.0]
    return flat_data


def messages(simulation, topic):
    got = []
    simulation.graph.subscribe(topic, got.append)
    return got


def test_lost_motor_at_its_time_brings_a_quadrotor_down(simulate, airborne):
    airborne["faults"] = [{"kind": "motor", "uav": "uav1", "rotor": 0, "at_s": 1.0}]
    simulation = simulate(airborne)
    simulation.run(1.0)
    health = simulation._engine.fleet.state.rotor_health[0]
    assert simulation.uavs["uav1"].position_map[2] == pytest.approx(20.0, abs=0.02)
    simulation.run(3.0)
    assert health[0] == 0.0
    assert simulation.uavs["uav1"].position_map[2] < 15.0


def test_weak_motor_for_a_while(simulate, airborne):
    simulation = simulate(airborne)
    simulation.faults.inject(
        {"kind": "motor", "uav": "uav1", "rotor": 2, "thrust_factor": 0.7, "until_s": 1.0}
    )
    simulation.run(0.5)
    assert simulation._engine.fleet.state.rotor_health[0, 2] == 0.7
    simulation.run(4.0)
    assert simulation._engine.fleet.state.rotor_health[0, 2] == 1.0
    np.testing.assert_allclose(simulation.uavs["uav1"].position_map, [0, 0, 20], atol=0.2)


def test_sensors_fall_silent_stick_and_err(simulate, airborne):
    airborne["faults"] = [
        {"kind": "sensor", "uav": "uav1", "sensor": "imu", "effect": "dropped",
         "at_s": 0.1, "until_s": 0.2},
        {"kind": "sensor", "uav": "uav1", "sensor": "imu", "effect": "biased",
         "bias": [1.0, 0, 0, 0, 0, 0], "at_s": 0.3, "until_s": 0.4},
        {"kind": "sensor", "uav": "uav1", "sensor": "imu", "effect": "stuck", "at_s": 0.5},
    ]  # fmt: skip
    simulation = simulate(airborne)
    got = messages(simulation, "/uav1/imu")
    simulation.run(0.6)
    times = np.array([m.time_ns for m in got]) / 1e9
    rates = np.array([m.message.angular_velocity.x for m in got])
    assert not ((times > 0.1) & (times <= 0.2)).any()
    assert rates[(times > 0.3) & (times <= 0.4)].min() > 0.9
    assert np.abs(rates[times < 0.3]).max() < 0.1
    assert len(set(rates[times > 0.5])) == 1


def test_noise_disturbs_a_published_position_and_its_autopilot_not(simulate, airborne):
    """Odometry with noise of 0.5 m for a second, on the graph; the same again after a restore."""
    simulation = simulate(airborne)
    got = messages(simulation, "/uav1/odom")
    fault = {"kind": "sensor", "uav": "uav1", "sensor": "odom", "effect": "noisy",
             "sigma": [0.5, 0.5, 0.0], "at_s": 0.5, "until_s": 1.5}  # fmt: skip
    simulation.faults.inject(fault)
    kept = simulation.snapshot()
    flights = []
    for _ in range(2):
        got.clear()
        simulation.run(2.0)
        times = np.array([m.time_ns for m in got]) / 1e9
        points = (m.message.pose.pose.position for m in got)
        flights.append(np.array([[p.x, p.y, p.z] for p in points]))
        noisy = flights[-1][(times > 0.5) & (times <= 1.5)]
        assert np.abs(flights[-1][(times <= 0.5) | (times > 1.5)][:, :2]).max() < 0.05
        np.testing.assert_allclose(noisy[:, :2].std(axis=0), 0.5, rtol=0.4)
        assert np.abs(noisy[:, 2] - 20.0).max() < 0.05
        np.testing.assert_allclose(simulation.uavs["uav1"].position_map, [0, 0, 20], atol=0.05)
        simulation.restore(kept)
    np.testing.assert_array_equal(*flights)


def test_gust_pushes_and_displacement_moves(simulate, airborne):
    airborne["faults"] = [
        {"kind": "gust", "velocity_m_s": [8.0, 0.0, 0.0], "rise_s": 0.2, "hold_s": 0.5, "at_s": 1.0}
    ]
    simulation = simulate(airborne)
    uav = simulation.uavs["uav1"]
    simulation.run(1.8)
    pushed = uav.position_map[0]
    assert pushed > 0.1
    simulation.run(6.0)
    assert abs(uav.position_map[0]) < 0.1
    simulation.faults.inject({"kind": "displacement", "uav": "uav1", "offset_m": [0.0, 3.0, 1.0]})
    simulation.step(1)
    np.testing.assert_allclose(uav.position_map[1:], [3.0, 21.0], atol=0.05)
    simulation.run(8.0)
    np.testing.assert_allclose(uav.position_map, [0, 0, 20], atol=0.2)


def test_lost_satellites(simulate, airborne):
    airborne["types"]["f450"]["sensors"].append({"kind": "gnss"})
    airborne["faults"] = [{"kind": "gnss_loss", "uav": "uav1", "at_s": 1.0, "until_s": 2.0}]
    simulation = simulate(airborne)
    got = messages(simulation, "/uav1/fix")
    simulation.run(5.0)
    lost = [m.message.status.status < 0 for m in got]
    stamps = [m.message.header.stamp.sec + m.message.header.stamp.nanosec / 1e9 for m in got]
    for stamp, is_lost in zip(stamps, lost, strict=True):
        # and a second after the last fix that was denied to find them again
        assert is_lost == (1.0 <= stamp < 2.79), stamp


def test_faults_are_part_of_what_is_kept(simulate, airborne):
    airborne["faults"] = [
        {"kind": "motor", "uav": "uav1", "rotor": 1, "thrust_factor": 0.8, "at_s": 0.5}
    ]
    simulation = simulate(airborne)
    simulation.diagnostics.enable_digest()
    simulation.run(0.3)
    kept = simulation.snapshot()
    simulation.run(1.0)
    first = simulation.diagnostics.digest()
    simulation.restore(kept)
    simulation.run(1.0)
    assert simulation.diagnostics.digest() == first
    simulation.reset()
    simulation.run(1.3)
    assert simulation.diagnostics.digest() == first


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        ({"kind": "motor", "uav": "uav9", "rotor": 0}, "no UAV 'uav9'; known: uav1"),
        ({"kind": "motor", "uav": "uav1", "rotor": 4}, "no rotor 4; 0 to 3 exist"),
        ({"kind": "sensor", "uav": "uav1", "sensor": "x", "effect": "stuck"}, "known: imu"),
        ({"kind": "sensor", "uav": "uav1", "sensor": "imu", "effect": "biased", "bias": [1.0]},
         "6 finite numbers"),
        ({"kind": "sensor", "uav": "uav1", "sensor": "imu", "effect": "noisy", "sigma": [1.0]},
         "the sigma must be 6 finite numbers"),
        ({"kind": "jamming", "position_m": [0.0, 0.0, 5.0]}, "the scenario has no .radio."),
        ({"kind": "gnss_loss", "uav": "uav1"}, "no GNSS receiver"),
    ],
)  # fmt: skip
def test_faults_that_cannot_be_are_refused(simulate, airborne, fault, words):
    simulation = simulate(airborne)
    with pytest.raises(CommandError, match=words):
        simulation.faults.inject(fault)
    airborne["faults"] = [fault]
    with pytest.raises(ScenarioError, match=rf"faults\[0\]: .*{words}"):
        simulate(airborne)


@pytest.mark.parametrize(
    "fault",
    [
        {"kind": "motor", "uav": "uav1", "rotor": 0, "at_s": 2.0, "until_s": 1.0},
        {"kind": "motor", "uav": "uav1", "rotor": 0, "thrust_factor": 1.5},
        {"kind": "sensor", "uav": "uav1", "sensor": "imu", "effect": "stuck", "bias": [1.0]},
        {"kind": "sensor", "uav": "uav1", "sensor": "imu", "effect": "stuck", "sigma": [1.0]},
        {"kind": "sensor", "uav": "uav1", "sensor": "imu", "effect": "noisy"},
        {"kind": "sensor", "uav": "uav1", "sensor": "imu", "effect": "noisy", "sigma": [-1.0]},
        {"kind": "jamming", "uav": "uav1", "position_m": [0.0, 0.0, 5.0]},
        {"kind": "jamming", "position_m": [0.0, 0.0, 5.0], "at_s": 2.0, "until_s": 1.0},
        {"kind": "plague", "uav": "uav1"},
    ],
)
def test_impossible_data_is_refused(simulate, airborne, fault):
    with pytest.raises(CommandError, match="fault"):
        simulate(airborne).faults.inject(fault)


def test_the_worst_of_overlapping_faults_decides(simulate, airborne):
    airborne["faults"] = [
        {"kind": "motor", "uav": "uav1", "rotor": 0, "thrust_factor": f, "at_s": a, "until_s": b}
        for f, a, b in ((0.9, 0.1, 0.3), (0.8, 0.2, 0.4))
    ]
    simulation = simulate(airborne)
    health = simulation._engine.fleet.state.rotor_health
    found = []
    for _ in range(5):
        simulation.run(0.1)
        simulation.step(1)
        found.append(float(health[0, 0]))
    assert found == [0.9, 0.8, 0.8, 1.0, 1.0]
    details = [e.detail for e in simulation.diagnostics.events if e.kind == "fault"]
    assert details == ["fault: motor"] * 2 + ["fault over: motor"] * 2


@pytest.mark.parametrize("offset", [[0.0, 0.0, -50.0], [1e6, 0.0, 0.0]])
def test_no_uav_is_moved_out_of_the_world(simulate, airborne, offset):
    simulation = simulate(airborne)
    with pytest.raises(CommandError, match="would be displaced"):
        simulation.faults.inject({"kind": "displacement", "uav": "uav1", "offset_m": offset})
    simulation.run(0.1)
