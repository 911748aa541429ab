"""IMU, sonar, odometry, nodding angle: exact without noise, of the stated noise with it."""

import math

import numpy as np
import pytest

from volery.core import rotations
from volery.sensors.imu import ImuModel
from volery.sensors.odometry import OdometryModel

G = 9.80665


def messages(simulation, topic, seconds):
    got = []
    simulation.graph.subscribe(topic, lambda m: got.append(m.message))
    simulation.run(seconds)
    return got


def quiet(data):
    for sensor in data["types"]["f450"]["sensors"]:
        if sensor["kind"] != "ground_truth":
            sensor["noise"] = False
    return data


def vector(v):
    return np.array([v.x, v.y, v.z])


def test_imu_feels_gravity_at_rest_and_nothing_else(simulate, flat_data):
    (*_, last) = messages(simulate(quiet(flat_data)), "/uav1/imu", 0.5)
    np.testing.assert_allclose(vector(last.linear_acceleration), [0, 0, G], atol=1e-3)
    np.testing.assert_allclose(vector(last.angular_velocity), 0.0, atol=1e-3)


def test_imu_mounted_sideways_sees_gravity_along_its_own_axis(simulate, flat_data):
    flat_data["types"]["f450"]["sensors"] = [
        {"kind": "imu", "rpy_deg": [0.0, 90.0, 0.0], "noise": False}
    ]
    (*_, last) = messages(simulate(flat_data), "/uav1/imu", 0.5)
    # Its x axis looks down: specific force points up, along -x.
    np.testing.assert_allclose(vector(last.linear_acceleration), [-G, 0, 0], atol=1e-3)


def test_imu_integrates_to_the_true_velocity(simulate, flat_data):
    """Specific force, turned into the map and freed of gravity, adds up to the velocity."""
    flat_data["types"]["f450"]["sensors"] = [
        {"kind": "imu", "rate_hz": 1000.0, "noise": False},
        {"kind": "ground_truth", "rate_hz": 1000.0},
    ]
    flat_data["uavs"][0]["on_start"] = "take_off"
    simulation = simulate(flat_data)
    attitudes = []
    simulation.graph.subscribe(
        "/uav1/ground_truth/odom", lambda m: attitudes.append(m.message.pose.pose.orientation)
    )
    messages_ = messages(simulation, "/uav1/imu", 4.0)
    simulation.uavs["uav1"].go_to([4.0, 2.0, 3.0])
    simulation.run(1.5)
    force = np.array([vector(r.linear_acceleration) for r in messages_[1:]])
    attitude = np.array([[q.x, q.y, q.z, q.w] for q in attitudes[1:]])
    velocity = (rotations.rotate(attitude, force) - [0, 0, G]).sum(axis=0) * 1e-3
    np.testing.assert_allclose(velocity, simulation.uavs["uav1"].velocity_map, atol=0.05)
    assert np.linalg.norm(simulation.uavs["uav1"].velocity_map) > 0.5


def test_imu_lever_arm_feels_centripetal_acceleration(simulate, flat_data):
    lever = 0.3
    flat_data["types"]["f450"]["sensors"] = [
        {"kind": "imu", "position_m": [lever, 0.0, 0.0], "noise": False}
    ]
    simulation = simulate(flat_data)
    simulation._engine.fleet.state.omega_body[0] = [0.0, 0.0, 2.0]
    simulation._engine.fleet.state.acceleration_map[0] = 0.0
    (bank,) = simulation._engine.banks
    force = bank.sample(0, 0, simulation._engine.fleet).specific_force[0]
    np.testing.assert_allclose(force, [-(2.0**2) * lever, 0.0, G], atol=1e-9)


def test_imu_noise_is_as_its_model_says(simulate, flat_data):
    model = ImuModel.load("adis16448")
    flat_data["types"]["f450"]["sensors"] = [{"kind": "imu"}]
    flat_data["uavs"][0]["count"] = 5
    simulation = simulate(flat_data)
    rows = [[] for _ in range(5)]
    for i, name in enumerate(simulation.vehicles.names):
        simulation.graph.subscribe(f"/{name}/imu", lambda m, i=i: rows[i].append(m.message))
    simulation.run(20.0)
    gyro = np.array([[vector(m.angular_velocity) for m in row[200:]] for row in rows])
    accel = np.array([[vector(m.linear_acceleration) for m in row[200:]] for row in rows])
    # White noise: from differences of neighbours, which the slow bias leaves alone.
    for data, density in (
        (gyro, model.gyro_noise_density_rad_s_sqrt_hz),
        (accel, model.accel_noise_density_m_s2_sqrt_hz),
    ):
        sigma = np.diff(data, axis=1).std() / math.sqrt(2.0)
        assert sigma == pytest.approx(density * math.sqrt(200.0), rel=0.03)
    turn_on = gyro.mean(axis=1)
    assert 0.4 < turn_on.std() / model.gyro_turn_on_bias_rad_s < 1.7
    stated = math.sqrt(simulation_variance(rows[0][0]))
    assert stated == pytest.approx(model.gyro_noise_density_rad_s_sqrt_hz * math.sqrt(200.0))


def simulation_variance(message):
    return float(message.angular_velocity_covariance[0])


def test_imu_random_walk_grows_as_its_model_says():
    from volery.core.clock import Schedule
    from volery.sensors.bank import SensorGroup
    from volery.sensors.imu import ImuBank
    from volery.sensors.mount import make_mount
    from volery.sensors.samples import SensorId

    model = ImuModel.load("adis16448").model_copy(update={"gyro_turn_on_bias_rad_s": 0.0})
    count = 400
    sensors = tuple(SensorId(0, f"u{i}", "imu") for i in range(count))
    keys, mounts = np.arange(count, dtype=np.uint64), (make_mount(),) * count
    bank = ImuBank(model, SensorGroup(Schedule.from_hz(200.0), sensors, mounts, keys))
    state = still_fleet()
    seconds = 5.0
    for k in range(int(200 * seconds)):
        bank.sample(k, 0, state)
    walked = bank.get_state()["bias"][:, :3].std()
    expected = model.gyro_random_walk_rad_s2_sqrt_hz * math.sqrt(seconds)
    assert walked == pytest.approx(expected, rel=0.1)


def still_fleet():
    from volery.control.fleet import Fleet
    from volery.vehicle.airframe import load_airframe

    return Fleet([load_airframe("f450")], [[0.0, 0.0, 1.0]], [[0.0, 0.0, 0.0, 1.0]])


def test_sonar_measures_the_height_and_says_when_it_cannot(simulate, flat_data):
    quiet(flat_data)
    flat_data["uavs"] = [
        {"type": "f450", "position_m": [0.0, 0.0, 5.0]},
        {"type": "f450", "position_m": [5.0, 0.0, 20.0]},
        {"type": "f450", "position_m": [9.0, 0.0]},
    ]
    simulation = simulate(flat_data)
    got = {}
    for name in simulation.vehicles.names:
        simulation.graph.subscribe(f"/{name}/range", lambda m, n=name: got.update({n: m.message}))
    simulation.run(0.05)
    assert got["uav1"].range == pytest.approx(5.0 - 0.05, abs=1e-3)
    assert got["uav2"].range == math.inf
    assert got["uav3"].range == -math.inf  # 7 cm above ground, nearer than it can measure
    assert got["uav1"].radiation_type == 0
    assert (got["uav1"].min_range, got["uav1"].max_range) == pytest.approx((0.2, 7.65))


def test_sonar_sees_a_uav_below_but_not_its_own_body(simulate, flat_data):
    quiet(flat_data)
    flat_data["uavs"] = [
        {"type": "f450", "position_m": [0.0, 0.0, 7.0]},
        {"type": "f450", "position_m": [0.0, 0.0, 4.0]},
    ]
    (first, *_) = messages(simulate(flat_data), "/uav1/range", 0.01)
    assert first.range == pytest.approx(7.0 - 0.05 - 4.0 - 0.11, abs=0.08)


def test_odometry_without_noise_is_the_truth(simulate, flat_data):
    flat_data["uavs"][0]["on_start"] = "take_off"
    simulation = simulate(quiet(flat_data))
    truth = []
    simulation.graph.subscribe("/uav1/ground_truth/odom", lambda m: truth.append(m.message))
    odometry = messages(simulation, "/uav1/odom", 3.0)
    for ours, true in zip(odometry, truth, strict=True):
        np.testing.assert_allclose(
            vector(ours.pose.pose.position), vector(true.pose.pose.position), atol=1e-9
        )
    assert odometry[-1].pose.pose.position.z > 1.0
    assert odometry[-1].header.frame_id == "uav1/odom"
    assert truth[-1].header.frame_id == "map"


def test_odometry_drifts_with_distance_and_says_so():
    from volery.core.clock import Schedule
    from volery.sensors.bank import SensorGroup
    from volery.sensors.mount import make_mount
    from volery.sensors.odometry import OdometryBank
    from volery.sensors.samples import SensorId

    count, distance = 500, 100.0
    model = OdometryModel.load("visual_inertial")
    fleet = still_fleet()
    sensors = tuple(SensorId(0, f"u{i}", "odom") for i in range(count))
    keys = np.arange(count, dtype=np.uint64)
    group = SensorGroup(Schedule.from_hz(50.0), sensors, (make_mount(),) * count, keys)
    bank = OdometryBank(model, group, fleet)
    start = fleet.state.position_map[0].copy()
    for k in range(200):
        fleet.state.position_map[0, 0] = start[0] + distance * (k + 1) / 200
        reading = bank.sample(k, 0, fleet)
    error = reading.position_odom - fleet.state.position_map[0]
    along = model.horizontal_drift_m_sqrt_m * math.sqrt(distance)
    # A random walk of the yaw bends the path: sideways variance yaw_drift^2 distance^3 / 3.
    across = math.hypot(along, model.yaw_drift_rad_sqrt_m * math.sqrt(distance**3 / 3.0))
    assert error[:, 0].std() == pytest.approx(along, rel=0.1)
    assert error[:, 1].std() == pytest.approx(across, rel=0.1)
    assert math.sqrt(reading.pose_variance[0, 1]) == pytest.approx(across, rel=1e-6)
    yaw_error = rotations.yaw_of(reading.attitude)
    yaw_sigma = model.yaw_drift_rad_sqrt_m * math.sqrt(distance)
    assert yaw_error.std() == pytest.approx(yaw_sigma, rel=0.1)
    up = model.vertical_drift_m_sqrt_m**2 * distance
    assert reading.pose_variance[0, 2:] == pytest.approx([up, 0.0, 0.0, yaw_sigma**2])
    twist = [model.velocity_noise_m_s**2] * 3 + [model.rate_noise_rad_s**2] * 3
    assert reading.twist_variance[0] == pytest.approx(twist)


def test_odometry_messages_have_the_variances_on_the_diagonal(simulate, flat_data):
    model = OdometryModel.load("visual_inertial")
    twist = messages(simulate(flat_data), "/uav1/odom", 0.1)[-1].twist.covariance.reshape(6, 6)
    known = [model.velocity_noise_m_s**2] * 3 + [model.rate_noise_rad_s**2] * 3
    np.testing.assert_allclose(twist, np.diag(known))


def test_standing_still_odometry_does_not_drift(simulate, flat_data):
    first, *_, last = messages(simulate(flat_data), "/uav1/odom", 3.0)
    drift = vector(first.pose.pose.position) - vector(last.pose.pose.position)
    assert np.abs(drift).max() < 0.02


def test_nodding_angle_swings_as_the_scenario_says(simulate, wood_data):
    wood_data["types"]["surveyor"]["nodes"] = []
    joints = messages(simulate(wood_data), "/uav1/joint_states", 2.0)
    angles = np.array([m.position[0] for m in joints])
    rates = np.array([m.velocity[0] for m in joints])
    assert angles.max() == pytest.approx(math.radians(45.0), rel=1e-3)
    assert angles.min() == pytest.approx(-math.radians(45.0), rel=1e-3)
    assert rates[0] == pytest.approx(math.radians(45.0) * math.pi, rel=0.01)
    np.testing.assert_allclose(np.gradient(angles, 1 / 80)[1:-1], rates[1:-1], atol=0.03)


def test_bank_state_can_be_kept_and_restored(simulate, flat_data):
    simulation = simulate(flat_data)
    simulation.run(0.2)
    for bank in simulation._engine.banks:
        kept = bank.get_state()
        first = bank.sample(99, 0, simulation._engine.fleet)
        bank.set_state(kept)
        again = bank.sample(99, 0, simulation._engine.fleet)
        for name, value in vars(first).items():
            if isinstance(value, np.ndarray):
                np.testing.assert_array_equal(value, getattr(again, name))
