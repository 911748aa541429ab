"""UAVs that fly on estimates from their own sensors."""

import copy

import numpy as np
import pytest

from volery.core.errors import ScenarioError
from volery.graph.codecs.zero import zero_message
from volery.graph.messages import Odometry
from volery.scenario.load import parse_scenario

AIDS = [
    {"kind": "imu"},
    {"kind": "gnss"},
    {"kind": "barometer"},
    {"kind": "magnetometer"},
    {"kind": "sonar", "position_m": [0.0, 0.0, -0.05], "rpy_deg": [0.0, 90.0, 0.0]},
]


@pytest.fixture
def estimating_data(flat_data):
    flat_data["types"]["f450"]["sensors"] = [*AIDS, {"kind": "estimate"}]
    flat_data["world"] = {"wind": {"velocity_m_s": [2.0, 0.0, 0.0], "turbulence": "light"}}
    return flat_data


def errors_of(simulation):
    """Time, error (3,) m and standard deviation (3,) m of every odometry message."""
    rows = []

    def on_odometry(published):
        message = published.message
        position = message.pose.pose.position
        error = (
            np.array([position.x, position.y, position.z]) - simulation.uavs["uav1"].position_map
        )
        sigma = np.sqrt(np.diag(np.reshape(message.pose.covariance, (6, 6)))[:3])
        rows.append((published.time_ns / 1e9, *error, *sigma))

    simulation.graph.subscribe("/uav1/odom", on_odometry)
    return rows


def test_flies_on_estimates_through_an_outage_and_lands(simulate, estimating_data):
    simulation = simulate(estimating_data)
    rows = errors_of(simulation)
    uav = simulation.uavs["uav1"]
    uav.take_off(5.0)
    simulation.run(8.0)
    uav.go_to([15.0, 5.0, 6.0])
    simulation.run(10.0)
    np.testing.assert_allclose(uav.position_map, [15.0, 5.0, 6.0], atol=2.5)
    simulation.faults.inject({"kind": "gnss_loss", "uav": "uav1", "at_s": 18.0, "until_s": 38.0})
    simulation.run(21.0)
    simulation.run(6.0)
    uav.land()
    simulation.run(25.0)
    assert uav.mode.name == "LANDED"
    assert not uav.crashed

    down = next(e.time_ns for e in simulation.diagnostics.events if e.kind == "touch_down") / 1e9
    t, *columns = np.array([row for row in rows if row[0] < down]).T
    error, sigma = np.abs(columns[:3]), np.array(columns[3:])
    inside = (error < 3.0 * sigma).mean(axis=1)
    assert (inside > 0.97).all()
    before, end = (t > 10.0) & (t < 18.0), (t > 37.0) & (t < 38.0)
    assert sigma[:2, before].max() < 1.0
    assert sigma[:2, end].min() > 3.0  # it says that it drifts
    assert error[:2, end].max() > 3.0 * error[:2, before].max()  # and it does
    assert error[:2, (t > 41.0) & (t < 45.0)].max() < 2.5


def test_estimates_may_be_published_and_not_flown_on(simulate, estimating_data):
    estimating_data["types"]["f450"]["sensors"][-1]["used_for_control"] = False
    simulation = simulate(estimating_data)
    rows = errors_of(simulation)
    uav = simulation.uavs["uav1"]
    uav.take_off(5.0)
    simulation.run(10.0)
    at_rest = uav.position_map[:2]
    assert np.hypot(*at_rest) < 0.3  # the start's error of half a metre is not flown out
    assert max(abs(row[1]) for row in rows) > 0.05


def test_flights_on_estimates_are_repeated_restored_and_reset(simulate, estimating_data):
    digests = []
    for slices in ([4.0], [0.0073] * 400 + [1.08]):
        simulation = simulate(estimating_data)
        simulation.diagnostics.enable_digest()
        simulation.uavs["uav1"].take_off(3.0)
        for seconds in slices:
            simulation.run(seconds)
        digests.append(simulation.diagnostics.digest())
    assert digests[0] == digests[1]
    kept = simulation.snapshot()
    simulation.run(2.0)
    later = simulation.diagnostics.digest()
    simulation.restore(kept)
    simulation.run(2.0)
    assert simulation.diagnostics.digest() == later
    simulation.reset()
    simulation.uavs["uav1"].take_off(3.0)
    simulation.run(4.0)
    assert simulation.diagnostics.digest() == digests[0]


def test_other_seeds_begin_elsewhere_near_the_truth(simulate, estimating_data):
    simulation = simulate(estimating_data)
    firsts = []
    for seed in (1, 2, 3):
        simulation.reset(seed)
        rows = errors_of(simulation)
        simulation.run(0.05)
        firsts.append(rows[0][1:4])
    assert len({round(x, 6) for x, _, _ in firsts}) == 3
    assert np.abs(firsts).max() < 3.0


def test_an_estimate_needs_an_imu(estimating_data):
    estimating_data["types"]["f450"]["sensors"] = [{"kind": "gnss"}, {"kind": "estimate"}]
    with pytest.raises(ScenarioError, match='needs one of kind "imu"'):
        parse_scenario(estimating_data)


def test_reset_with_another_seed_is_a_fresh_start(simulate, estimating_data):
    """Also where UAVs take off by themselves, to a height above where they believe to be."""
    estimating_data["world"]["seed"] = 1
    estimating_data["uavs"][0]["on_start"] = "take_off"
    used, fresh = simulate(estimating_data), simulate({**estimating_data, "seed": 7})
    used.run(1.3)
    used.reset(7)
    for simulation in (used, fresh):
        simulation.diagnostics.enable_digest()
        simulation.run(3.0)
    assert used.diagnostics.digest() == fresh.diagnostics.digest()


SLIP_M = 3.0


class Slam:
    """In place of a SLAM: the truth 25 times a second, 0.1 s late, and slipped aside."""

    def __init__(self, simulation):
        self._out = simulation.graph.advertise("/uav1/slam/odom", Odometry)
        self._waiting = []
        self.slip = 0.0
        simulation.graph.subscribe("/uav1/ground_truth/odom", self._receive)

    def _receive(self, published):
        message = copy.deepcopy(published.message)
        message.pose.pose.position.y += self.slip
        self._waiting.append(message)
        if len(self._waiting) > 5:
            late = self._waiting.pop(0)
            if late.header.stamp.nanosec % 40_000_000 == 0:
                self._out.publish(late)


@pytest.fixture
def slam_data(estimating_data):
    estimating_data["world"]["gnss_denied"] = True
    estimating_data["types"]["f450"]["sensors"] = [
        {"kind": "imu"},
        {"kind": "estimate", "external_odometry": {"topic": "slam/odom"}},
        {"kind": "ground_truth"},
    ]
    return estimating_data


def hovers_at_ten_metres(simulation):
    uav = simulation.uavs["uav1"]
    uav.take_off(3.0)
    simulation.run(6.0)
    uav.go_to([10.0, 0.0, 3.0])
    simulation.run(10.0)
    return uav


def test_it_flies_where_a_slam_says_that_it_is(simulate, slam_data):
    simulation = simulate(slam_data)
    slam = Slam(simulation)
    uav = hovers_at_ten_metres(simulation)
    np.testing.assert_allclose(uav.position_map, [10.0, 0.0, 3.0], atol=0.35)
    slam.slip = SLIP_M  # believed after a second
    simulation.run(10.0)
    np.testing.assert_allclose(uav.position_map, [10.0, -SLIP_M, 3.0], atol=0.5)


def test_without_its_slam_it_strays(simulate, slam_data):
    simulation = simulate(slam_data)
    uav = hovers_at_ten_metres(simulation)
    simulation.run(15.0)
    assert np.linalg.norm(uav.position_map - [10.0, 0.0, 3.0]) > 1.0


def odometry(**changed):
    """One second old, somewhere else; `changed`: seconds, x, w."""
    message = zero_message("nav_msgs/msg/Odometry")
    message.header.stamp.sec = changed.get("seconds", 1)
    message.pose.pose.position.x = changed.get("x", 50.0)
    message.pose.pose.orientation.w = changed.get("w", 1.0)
    return message


NAN = float("nan")


@pytest.mark.parametrize("changed", [{"x": NAN}, {"w": NAN}, {"w": 0.0}, {"seconds": 90}])
def test_poses_that_cannot_be_are_left_out(simulate, slam_data, changed):
    digests = []
    for message in (None, odometry(**changed)):
        simulation = simulate(slam_data)
        publisher = simulation.graph.advertise("/uav1/slam/odom", Odometry)
        simulation.run(1.02)
        if message is not None:
            publisher.publish(message)
        simulation.run(0.5)
        digests.append(simulation.uavs["uav1"].position_map.tobytes() + odometry_of(simulation))
    assert digests[0] == digests[1]


def test_what_it_took_from_its_slam_is_kept_in_a_snapshot(simulate, slam_data):
    simulation = simulate(slam_data)
    publisher = simulation.graph.advertise("/uav1/slam/odom", Odometry)
    simulation.run(1.02)
    publisher.publish(odometry(x=0.3))
    simulation.run(0.05)
    kept = simulation.snapshot()

    def on():
        simulation.run(0.02)
        publisher.publish(odometry(x=0.3))  # is not newer
        simulation.run(0.5)
        return odometry_of(simulation)

    first = on()
    simulation.restore(kept)
    assert on() == first


def odometry_of(simulation):
    received = []
    topic = simulation.graph.subscribe("/uav1/odom", lambda one: received.append(one.cdr))
    simulation.run(0.1)
    topic.cancel()
    return received[-1]


def test_it_stays_while_it_stands_and_reports_that_no_poses_come(simulate, slam_data):
    """Without poses the IMU alone would carry the estimate away by hundreds of metres."""
    simulation = simulate(slam_data)
    rows = errors_of(simulation)
    simulation.run(45.0)
    at_start, at_end = np.array(rows[0][1:4]), np.array(rows[-1][1:4])
    assert np.linalg.norm(at_end - at_start) < 0.5
    warnings = [
        event.describe()
        for event in simulation.diagnostics.events
        if "receives no poses" in event.detail
    ]
    assert len(warnings) == 1
    assert warnings[0].startswith("5.0")
    assert "slam/odom" in warnings[0]
