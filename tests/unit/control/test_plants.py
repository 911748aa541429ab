"""Identified and kinematic plants: exactness, agreement with the rigid body, slices, snapshots."""

import math

import numpy as np
import pytest
from flights import F450, FLAT, LEVEL, track
from scipy.linalg import expm
from standing import standing_pose

from volery.control.fleet import Fleet
from volery.control.fleet_events import FleetEventKind
from volery.control.flight_modes import FlightMode
from volery.control.trajectory import Trajectory
from volery.core import rotations
from volery.core.clock import NS_PER_S
from volery.core.errors import CommandError
from volery.vehicle.identified import FirstOrder, SecondOrder, load_identified, transition
from volery.vehicle.kinematic import Kinematic
from volery.vehicle.plant_types import RigidBody
from volery.world.terrain import Terrain
from volery.world.weather import Weather

IDENTIFIED, KINEMATIC = load_identified("f450"), Kinematic()
PLANTS = {"identified": IDENTIFIED, "kinematic": KINEMATIC}


def flying(plant, position=(0.0, 0.0, 50.0), attitude=LEVEL, **options):
    return Fleet([F450], [position], [attitude], plants=plant, **options)


# ----------------------------------------------------------------------------- all of them fly


@pytest.mark.parametrize("name", PLANTS)
def test_a_whole_flight(name):
    pose = standing_pose(F450, FLAT, 0, 0, 0.5)
    fleet = flying(PLANTS[name], pose[:3], pose[3:], mode=FlightMode.LANDED)
    fleet.advance(1000, FLAT.grid)
    assert fleet.state.asleep[0]
    fleet.take_off(0, 5.0)
    track(fleet, 9.0)
    assert fleet.mode(0) is FlightMode.HOLD
    np.testing.assert_allclose(
        fleet.state.position_map[0], pose[:3] + np.array([0, 0, 5]), atol=0.05
    )
    fleet.command_position(0, (20, 10, 6), yaw=1.0)
    position, velocity, _ = track(fleet, 14.0)
    np.testing.assert_allclose(position[-1], (20, 10, 6), atol=0.05)
    assert np.hypot(*velocity[:, :2].T).max() < 1.1 * F450.limits.speed_m_s
    assert float(rotations.yaw_of(fleet.state.attitude[0])) == pytest.approx(1.0, abs=0.02)
    fleet.return_home(0, 8.0)
    track(fleet, 45.0)
    assert fleet.mode(0) is FlightMode.LANDED
    np.testing.assert_allclose(fleet.state.position_map[0], pose[:3], atol=0.1)
    assert fleet.state.asleep[0]
    assert [(e.kind.value, e.mode.name) for e in fleet.drain_events()] == [
        ("mode", "HOLD"),
        ("mode", "HOLD"),
        ("mode", "LAND"),
        ("touch_down", "LAND"),
        ("mode", "LANDED"),
    ]


def mixed_fleet():
    """Each plant in several modes, one going into the ground."""
    plants = [RigidBody(), IDENTIFIED, KINEMATIC, IDENTIFIED, KINEMATIC, Kinematic(0.2, True)]
    z = [30.0, 30.0, 30.0, 30.0, 1.0, 30.0]
    positions = [[8.0 * i, 0.0, z[i]] for i in range(6)]
    fleet = Fleet([F450] * 6, positions, [LEVEL] * 6, plants=plants)
    fleet.command_position(0, (10, 20, 40), yaw=1.0)
    fleet.command_velocity_body(1, (4, 1, 0), 0.4)
    t = np.linspace(0, 3, 7)
    path = np.stack([16 + t**2, np.sin(t), 30 + 0 * t], axis=1)
    fleet.command_trajectory(2, Trajectory.from_samples(t, path, yaw=t))
    fleet.command_attitude(3, rotations.from_rpy(0.2, -0.1, 0.5), F450.weight)
    fleet.command_velocity_map(4, (1, 0, -3))
    fleet.command_velocity_body(5, (30, 0, 0), 3.0)
    return fleet


def test_slicing_changes_nothing():
    whole, sliced = mixed_fleet(), mixed_fleet()
    for fleet in (whole, sliced):
        fleet.set_weather(Weather((2, 1, 0)))
    whole.advance(4000, FLAT.grid)
    rng = np.random.default_rng(0)
    while sliced.step < 4000:
        slice_ = min(int(rng.choice([1, 2, 3, 5, 7, 25, 100])), 4000 - sliced.step)
        sliced.advance(slice_, FLAT.grid)
    for key in ("uavs", "references"):
        assert whole.get_state()[key].tobytes() == sliced.get_state()[key].tobytes()
    np.testing.assert_array_equal(whole.history.position, sliced.history.position)
    assert whole.drain_events() == sliced.drain_events()


def test_snapshot_returns_exactly():
    fleet = mixed_fleet()
    fleet.advance(703, FLAT.grid)
    kept = fleet.get_state()
    fleet.advance(900, FLAT.grid)
    wanted = fleet.get_state()
    fleet.set_state(kept)
    fleet.advance(900, FLAT.grid)
    for key in ("uavs", "references"):
        assert fleet.get_state()[key].tobytes() == wanted[key].tobytes()


def test_company_changes_nothing():
    many = mixed_fleet()
    many.advance(1500, FLAT.grid)
    alone = flying(IDENTIFIED, (8.0, 0.0, 30.0))
    alone.command_velocity_body(0, (4, 1, 0), 0.4)
    alone.advance(1500, FLAT.grid)
    np.testing.assert_array_equal(alone.state.position_map[0], many.state.position_map[1])


@pytest.mark.parametrize(
    ("name", "method", "arguments"),
    [
        ("identified", "command_rotor_speeds", ([700] * 4,)),
        ("identified", "command_rates", ((0, 0, 0), 20)),
        ("identified", "command_pose", ((0, 0, 1), LEVEL)),
        ("kinematic", "command_rotor_speeds", ([700] * 4,)),
        ("kinematic", "command_rates", ((0, 0, 0), 20)),
        ("kinematic", "command_attitude", (LEVEL, 20)),
    ],
)
def test_what_a_plant_cannot_take_is_refused(name, method, arguments):
    fleet = flying(PLANTS[name])
    with pytest.raises(CommandError, match="its plant is"):
        getattr(fleet, method)(0, *arguments)


# ------------------------------------------------------------------------------------- identified


@pytest.mark.parametrize("damping", [0.5, 1.0, 1.6])
def test_transition_is_the_matrix_exponential(damping):
    loop = SecondOrder(kind="second_order", natural_frequency_rad_s=9.0, damping=damping)
    exact = expm(np.array([[0, 1], [-81, -18 * damping]]) * 0.004)
    np.testing.assert_allclose(transition(loop, 0.004).reshape(2, 2), exact, atol=1e-12)


def lagging(**changes):
    roll = {"kind": "first_order", "time_constant_s": 0.2, "gain": 0.85}
    return IDENTIFIED.model_copy(
        update={
            "roll": FirstOrder(**roll),
            "pitch": FirstOrder(**roll),
            "attitude_dead_time_s": 0.05,
            **changes,
        }
    )


def test_first_order_tilt_with_dead_time_is_exact():
    fleet = flying(lagging())
    fleet.command_attitude(0, rotations.from_rpy(0.1, 0, 0), F450.weight)
    fleet.advance(50, FLAT.grid)
    assert not fleet.state.omega_body[0].any()
    for k in range(1, 400):
        fleet.advance(1, FLAT.grid)
        roll = rotations.to_rpy(fleet.state.attitude[0])[0]
        # the tilt's half sine times the gain is what the loop aims at: 1e-4 of it
        assert roll == pytest.approx(0.085 * (1 - np.exp(-k * 1e-3 / 0.2)), abs=4e-5)


def test_second_order_tilt_is_exact():
    fleet = flying(IDENTIFIED.model_copy(update={"attitude_dead_time_s": 0.0}))
    fleet.command_attitude(0, rotations.from_rpy(0, 0.05, 0), F450.weight)
    w, damping, gain = (
        IDENTIFIED.pitch.natural_frequency_rad_s,
        IDENTIFIED.pitch.damping,
        IDENTIFIED.pitch.gain,
    )
    system = np.array([[0, 1], [-w * w, -2 * damping * w]])
    for _ in range(40):
        fleet.advance(10, FLAT.grid)
        exact = gain * 0.05 * (1 - expm(system * fleet.step * 1e-3)[0, 0])
        assert rotations.to_rpy(fleet.state.attitude[0])[1] == pytest.approx(exact, abs=2e-5)


def test_free_motion_is_linear_drag_and_gravity():
    fleet = flying(IDENTIFIED)
    fleet.command_attitude(0, LEVEL, 0.0)
    fleet.state.rotor_speed[0] = 0.0
    fleet._references[:, :, 4] = 0.0
    fleet.state.velocity_map[0] = (8, -3, 0)
    fleet.advance(2000, FLAT.grid)
    left = np.exp(-np.array(IDENTIFIED.drag_1_s[:2]) * 2.0)
    np.testing.assert_allclose(fleet.state.velocity_map[0, :2], left * [8, -3], rtol=2e-6)
    assert fleet.state.velocity_map[0, 2] == pytest.approx(-2 * 9.80665, rel=1e-9)


def test_wind_pushes_and_the_outer_loop_answers():
    fleet = flying(IDENTIFIED)
    fleet.set_weather(Weather((4, 0, 0)))
    fleet.advance(500, FLAT.grid)
    assert fleet.state.position_map[0, 0] > 0.1
    fleet.advance(20_000, FLAT.grid)
    np.testing.assert_allclose(fleet.state.position_map[0], [0, 0, 50], atol=0.01)


def test_a_crash_falls_and_rests():
    fleet = flying(IDENTIFIED, (0, 0, 10.0))
    fleet.command_attitude(0, LEVEL, 0.0)
    fleet.advance(4000, FLAT.grid)
    assert fleet.mode(0) is FlightMode.CRASHED
    assert fleet.state.asleep[0]
    assert any(e.kind is FleetEventKind.IMPACT for e in fleet.drain_events())


# -------------------------------------------------------------------------------------- kinematic


def test_a_twist_is_integrated_along_its_arc():
    fleet = flying(KINEMATIC, attitude=rotations.from_rpy(0, 0, 0.3))
    fleet.set_command_timeout(60.0)
    fleet.command_velocity_body(0, (2.0, 0.5, 0.1), 0.7)
    fleet.advance(10_000, FLAT.grid)
    turn, t = 0.7, 10.0
    a, b = 0.3, 0.3 + turn * t
    x = 2.0 * (np.sin(b) - np.sin(a)) / turn + 0.5 * (np.cos(b) - np.cos(a)) / turn
    y = -2.0 * (np.cos(b) - np.cos(a)) / turn + 0.5 * (np.sin(b) - np.sin(a)) / turn
    np.testing.assert_allclose(fleet.state.position_map[0], [x, y, 51.0], atol=1e-10)
    want = rotations.from_rpy(0, 0, b)
    assert abs(float(want @ fleet.state.attitude[0])) == pytest.approx(1.0, abs=1e-12)
    np.testing.assert_allclose(fleet.state.omega_body[0], [0, 0, 0.7])
    speed = fleet.state.velocity_map[0]
    np.testing.assert_allclose(
        rotations.rotate(rotations.conjugate(want), speed), (2.0, 0.5, 0.1), atol=1e-10
    )


def test_a_lag_and_limits_bind_where_wanted():
    fleet = flying(Kinematic(0.5, limited=True))
    fleet.set_command_timeout(60.0)
    fleet.command_velocity_map(0, (30, 0, 9))
    fleet.advance(1000, FLAT.grid)
    share = 1 - np.exp(-1 / 0.5)
    top = np.array([F450.limits.speed_m_s, 0, F450.limits.climb_m_s])
    np.testing.assert_allclose(fleet.state.velocity_map[0], share * top, rtol=1e-9)


def test_it_holds_when_commands_cease():
    fleet = flying(KINEMATIC)
    fleet.command_velocity_body(0, (3, 0, 0), 0.5)
    fleet.advance(5000, FLAT.grid)
    assert fleet.mode(0) is FlightMode.HOLD
    assert np.linalg.norm(fleet.state.velocity_map[0]) < 1e-3


def test_a_trajectory_is_met_at_every_step():
    fleet = flying(KINEMATIC, (5, 5, 50))
    t = np.array([0, 1.1, 2.0, 3.7])
    p = np.random.default_rng(1).normal(size=(4, 3)) + np.array([0, 0, 50])
    made = Trajectory.from_samples(t, p, yaw=[0, 1, 2, 3])
    fleet.command_trajectory(0, made)
    for _ in range(370):
        fleet.advance(10, FLAT.grid)
        point = made.at(fleet.step * 1e-3)
        np.testing.assert_allclose(fleet.state.position_map[0], point.position_map, atol=1e-9)
        np.testing.assert_allclose(fleet.state.velocity_map[0], point.velocity_map, atol=1e-8)
    assert float(rotations.yaw_of(fleet.state.attitude[0])) == pytest.approx(3.0, abs=1e-9)


def test_a_pose_is_taken_and_left():
    fleet = flying(KINEMATIC)
    tilted = rotations.from_rpy(0.3, -0.2, 1.0)
    fleet.state.contact_budget[0] = 100.0
    fleet.command_pose(0, (3, 4, 50), tilted, (1, 0, 0), (0, 0, 0.5))
    fleet.advance(10, FLAT.grid)
    np.testing.assert_array_equal(fleet.state.position_map[0], (3, 4, 50))
    np.testing.assert_allclose(fleet.state.attitude[0], tilted, atol=1e-12)
    np.testing.assert_array_equal(fleet.state.velocity_map[0], (1, 0, 0))
    assert fleet.state.contact_budget[0] == pytest.approx(95.0)
    fleet.hold(0)
    fleet.advance(4000, FLAT.grid)
    assert np.linalg.norm(fleet.state.position_map[0] - (3, 4, 50)) < 1.0
    assert np.linalg.norm(fleet.state.velocity_map[0]) < 1e-3
    np.testing.assert_allclose(fleet.state.attitude[0, :2], 0.0)


def test_a_stream_of_poses_has_the_velocity_between_them():
    """A circle of 2 m radius at 2 m/s: 2 m/s^2 towards its centre, without spikes."""
    fleet, period = flying(KINEMATIC), 20
    rates, felt = [], []
    for k in range(100):
        t = k * period * 1e-3
        position = 2.0 * np.array([math.sin(t), -math.cos(t), 0.0]) + (0, 0, 50)
        fleet.command_pose(
            0, position, rotations.from_rpy(0, 0, t), stamp_ns=round(t * NS_PER_S) + 5000
        )
        for _ in range(period):
            fleet.advance(1, FLAT.grid)
            rates.append(fleet.state.omega_body[0].copy())
            felt.append(fleet.state.acceleration_map[0].copy())
        np.testing.assert_array_equal(fleet.state.position_map[0], position)
        if k > 1:
            middle = t - 0.5 * period * 1e-3
            moving = 2.0 * np.array([math.cos(middle), math.sin(middle), 0.0])
            np.testing.assert_allclose(fleet.state.velocity_map[0], moving, atol=2e-3)
    size = np.linalg.norm(felt, axis=1)
    np.testing.assert_allclose(size[3 * period :], 2.0, atol=0.01)
    np.testing.assert_allclose(rates[3 * period :], np.tile([0, 0, 1], (97 * period, 1)), atol=1e-6)
    fleet.advance(1000, FLAT.grid)  # the stream ends
    np.testing.assert_array_equal(fleet.state.velocity_map[0], 0.0)
    np.testing.assert_array_equal(fleet.state.omega_body[0], 0.0)
    np.testing.assert_array_equal(fleet.state.position_map[0], position)


def test_poses_without_time_in_bursts_have_the_mean_velocity():
    fleet, rng = flying(KINEMATIC), np.random.default_rng(5)
    speeds, felt, sent = [], [], 0
    for step in range(3000):  # 2 m/s, poses every 20 ms that arrive up to 15 ms late
        if step >= 20 * sent + rng.integers(15):
            fleet.command_pose(0, (0.04 * sent, 0, 50), LEVEL)
            sent += 1
        if step % 50 == 0:  # twice at one instant
            fleet.command_pose(0, (0.04 * (sent - 1), 0, 50), LEVEL)
        fleet.advance(1, FLAT.grid)
        speeds.append(fleet.state.velocity_map[0, 0])
        felt.append(abs(fleet.state.acceleration_map[0, 0]))
    assert np.mean(speeds[500:]) == pytest.approx(2.0, abs=0.1)
    assert np.std(speeds[500:]) < 0.3
    assert max(felt) < 100.0


def _arrive_together(t):
    return 100 * (t // 100) + 99


def _swapped(poses):
    """Every tenth pose is overtaken by the next one."""
    for k in range(10, len(poses) - 1, 10):
        (at, *older), (_, *newer) = poses[k : k + 2]
        poses[k], poses[k + 1] = (at, *newer), (at + 1, *older)
    return poses


STREAMS = {  # (arrival, ms; time of the pose, ms; stamp, ms, or none) of a motion at 2 m/s
    "drawn twice": [(t, t - t % 20, t) for t in range(1, 3000, 10)],
    "drawn twice, without stamps": [(t, t - t % 20, None) for t in range(0, 3000, 10)],
    "sent twice": [(t, t - t % 20, t - t % 20) for t in range(0, 3000, 10)],
    "stamps of a slow clock": [(t, t, t - t % 100) for t in range(0, 3000, 20)],
    "bursts": [(_arrive_together(t), t, t) for t in range(1, 3000, 20)],
    "bursts without stamps": [(_arrive_together(t), t, None) for t in range(0, 3000, 20)],
    "overtaken": _swapped([(t, t, t) for t in range(1, 3000, 20)]),
    "a second apart": [(t + 30 * (t // 1000 % 2), t, None) for t in range(0, 8000, 1000)],
}


@pytest.mark.parametrize("name", STREAMS)
def test_streams_of_others_have_the_motion_that_they_show(name):
    """Poses that repeat, come in bursts, late or in disorder; attitudes of either sign."""
    fleet, poses = flying(KINEMATIC), list(STREAMS[name])
    slowest, fastest, felt = math.inf, 0.0, 0.0
    last, sign = poses[-1][0], 1.0
    for step in range(last):
        while poses[0][0] <= step:
            _, t, stamp = poses.pop(0)
            stamped = {} if stamp is None else {"stamp_ns": stamp * 1_000_000}
            turned = sign * rotations.from_rpy(0.0, 0.0, 2e-3 * t)
            fleet.command_pose(0, (2e-3 * t, 0, 50), turned, **stamped)
            sign = -sign
        fleet.advance(1, FLAT.grid)
        if step > max(1000, last - 2000):
            speed = float(fleet.state.velocity_map[0, 0])
            slowest, fastest = min(slowest, speed), max(fastest, speed)
            felt = max(felt, float(np.abs(fleet.state.acceleration_map[0]).max()))
            assert float(fleet.state.omega_body[0, 2]) == pytest.approx(speed, abs=1e-6)
    assert slowest == pytest.approx(2.0, abs=0.1)
    assert fastest == pytest.approx(2.0, abs=0.1)
    assert felt < 1.0


def test_a_pose_older_than_the_last_one_moves_nothing():
    fleet = flying(KINEMATIC)
    for t in (100, 120, 110):
        fleet.command_pose(0, (1e-3 * t, 0, 50), LEVEL, stamp_ns=t * 1_000_000)
        fleet.advance(1, FLAT.grid)
    assert fleet.state.position_map[0, 0] == pytest.approx(0.12)
    fleet.hold(0)  # another command ends the stream: the next one begins anew
    fleet.command_pose(0, (0.5, 0, 50), LEVEL, stamp_ns=110_000_000)
    fleet.advance(1, FLAT.grid)
    assert fleet.state.position_map[0, 0] == pytest.approx(0.5)


def test_poses_that_only_repeat_end_the_motion():
    fleet = flying(KINEMATIC)
    for step in range(2000):
        if step % 20 == 1:
            x = 2e-3 * min(step, 1000)
            fleet.command_pose(0, (x, 0, 50), LEVEL, stamp_ns=step * 1_000_000)
        fleet.advance(1, FLAT.grid)
    np.testing.assert_array_equal(fleet.state.velocity_map[0], 0.0)


@pytest.mark.parametrize("stamped", [True, False])
def test_a_teleport_is_no_speed(stamped):
    fleet = flying(KINEMATIC)
    fastest = felt = 0.0
    felt_later = []
    for k in range(100):
        x = 0.04 * k + (100.0 if k >= 50 else 0.0)
        stamp = {"stamp_ns": k * NS_PER_S // 50} if stamped else {}
        turned = rotations.from_rpy(0.0, 0.0, 3.0 if k >= 75 else 0.0)
        fleet.command_pose(0, (x, 0, 50), turned, **stamp)
        for _ in range(20):
            fleet.advance(1, FLAT.grid)
            fastest = max(fastest, float(np.linalg.norm(fleet.state.velocity_map[0])))
            felt = max(felt, float(np.linalg.norm(fleet.state.acceleration_map[0])))
            assert np.linalg.norm(fleet.state.omega_body[0]) < 1e-9
            felt_later += [float(np.linalg.norm(fleet.state.acceleration_map[0]))] * (k > 20)
    assert fastest < 2.01
    assert felt < 110.0  # from rest to 2 m/s within a period
    assert max(felt_later) < 2.0  # the motion goes on beyond both teleports
    assert fleet.state.velocity_map[0, 0] == pytest.approx(2.0, abs=0.01)


def test_a_teleport_to_rest_ends_the_motion():
    """As any end of a motion: without a spike."""
    fleet = flying(KINEMATIC)
    felt = []
    for k in range(100):
        x = 0.04 * k if k < 50 else 300.0
        fleet.command_pose(0, (x, 0, 50), LEVEL, stamp_ns=k * NS_PER_S // 50)
        for _ in range(20):
            fleet.advance(1, FLAT.grid)
            felt += [float(np.linalg.norm(fleet.state.acceleration_map[0]))] * (k > 20)
    np.testing.assert_array_equal(fleet.state.velocity_map[0], 0.0)
    assert max(felt) < 25.0  # from 2 m/s in a tenth of a second


@pytest.mark.parametrize(("speed", "kind"), [(0.5, "touch_down"), (5.0, "impact")])
def test_the_ground_stops_it_and_nothing_crashes(speed, kind):
    y, x = np.mgrid[0:41, 0:41] * 5.0
    ground = Terrain.from_heights(0.3 * x, 5.0, (-100.0, -100.0))
    z = float(ground.height(0, 0)) + 0.5
    fleet = flying(KINEMATIC, (0, 0, z))
    fleet.set_command_timeout(60.0)
    fleet.command_velocity_map(0, (1, 0, -speed))
    for _ in range(300):
        fleet.advance(10, ground.grid)
        x, y, z = fleet.state.position_map[0]
        assert z >= float(ground.height(x, y)) + F450.ground_offset - 1e-9
    assert fleet.state.on_ground[0]
    assert not fleet.state.crashed[0]
    (event,) = fleet.drain_events()
    assert event.kind.value == kind
    fleet.command_velocity_map(0, (0, 0, 1))
    fleet.advance(1000, ground.grid)
    assert not fleet.state.on_ground[0]
