"""Commands, flight modes, ground, slicing and snapshots of a `Fleet`."""

import numpy as np
import pytest
from flights import F450, FLAT, LEVEL, in_air, on_ground, ring, track
from standing import standing_pose

from volery.control.estimator.errors import EstimationError
from volery.control.fleet import Fleet
from volery.control.fleet_events import FleetEventKind
from volery.control.flight_modes import FlightMode
from volery.control.fused_step import UAV
from volery.control.setpoints import CONTROL_STATE
from volery.core import rotations
from volery.core.errors import CommandError
from volery.vehicle.fleet import BODY
from volery.vehicle.plant import contact_points
from volery.world.terrain import Terrain
from volery.world.weather import Gust, LogProfile, Weather

NAN, INF = float("nan"), float("inf")


def slope(degrees):
    y, x = np.mgrid[0:41, 0:41] * 5.0
    heights = np.tan(np.radians(degrees)) * (0.8 * x + 0.6 * y)
    return Terrain.from_heights(heights, 5.0, (-100.0, -100.0))


def kinds(fleet):
    return [(e.kind.value, e.mode.name) for e in fleet.drain_events()]


# ------------------------------------------------------------------------------------------ modes


def test_a_whole_flight():
    fleet = on_ground(yaw=0.5)
    start = fleet.state.position_map[0].copy()
    fleet.advance(1000, FLAT.grid)
    assert fleet.state.asleep[0]
    np.testing.assert_allclose(fleet.state.position_map[0], start, atol=1e-6)
    assert fleet.drain_events() == []

    fleet.take_off(0, 5.0)
    position, _, _ = track(fleet, 8.0)
    assert fleet.mode(0) is FlightMode.HOLD
    np.testing.assert_allclose(position[-1], start + np.array([0, 0, 5]), atol=0.05)
    assert np.abs(position[:, :2]).max() < 0.05
    assert float(rotations.yaw_of(fleet.state.attitude[0])) == pytest.approx(0.5, abs=0.01)

    fleet.command_position(0, (20, 10, 6))
    assert fleet.mode(0) is FlightMode.GO_TO
    track(fleet, 12.0)
    assert fleet.mode(0) is FlightMode.HOLD

    fleet.return_home(0, 8.0)
    position, _, _ = track(fleet, 40.0)
    assert position[:, 2].max() > start[2] + 7.7
    assert fleet.mode(0) is FlightMode.LANDED
    np.testing.assert_allclose(position[-1], start, atol=0.1)
    assert not fleet.state.rotor_speed[0].any()
    assert kinds(fleet) == [
        ("mode", "HOLD"),
        ("mode", "HOLD"),
        ("mode", "LAND"),
        ("touch_down", "LAND"),
        ("mode", "LANDED"),
    ]
    fleet.take_off(0, 2.0)  # and again
    track(fleet, 5.0)
    assert fleet.mode(0) is FlightMode.HOLD


def test_velocity_times_out():
    fleet = in_air()
    fleet.command_velocity_body(0, (3, 0, 0))
    fleet.advance(499, FLAT.grid)
    assert fleet.mode(0) is FlightMode.VELOCITY
    fleet.advance(9, FLAT.grid)  # within a guidance tick
    assert fleet.mode(0) is FlightMode.HOLD
    track(fleet, 6.0)
    position = fleet.state.position_map[0].copy()
    assert np.linalg.norm(fleet.state.velocity_map[0]) < 0.02
    track(fleet, 3.0)
    np.testing.assert_allclose(fleet.state.position_map[0], position, atol=0.02)


def test_time_out_is_each_uavs_own():
    fleet = Fleet([F450] * 2, [[0, 0, 50], [10, 0, 50]], [LEVEL] * 2)
    fleet.set_command_timeout(0.1, 1)
    for i in (0, 1):
        fleet.command_velocity_map(i, (1, 0, 0))
    fleet.advance(300, FLAT.grid)
    assert [fleet.mode(i) for i in (0, 1)] == [FlightMode.VELOCITY, FlightMode.HOLD]


def test_renewed_velocity_does_not_time_out():
    fleet = in_air()
    for _ in range(10):
        fleet.command_velocity_map(0, (1, 0, 0))
        fleet.advance(400, FLAT.grid)
        assert fleet.mode(0) is FlightMode.VELOCITY


def test_hold_brakes_first():
    fleet = in_air()
    fleet.set_command_timeout(60)
    fleet.command_velocity_map(0, (8, 0, 0))
    track(fleet, 6.0)
    fleet.hold(0)
    _, velocity, _ = track(fleet, 10.0)
    assert velocity[:, 0].min() > -0.6  # it does not fly back
    assert np.linalg.norm(velocity[-1]) < 0.02


@pytest.mark.parametrize("degrees", [0, 15, 25])
def test_lands_on_slopes(degrees):
    ground = slope(degrees)
    fleet = in_air((3, 2, float(ground.height(3, 2)) + 4.0))
    fleet.land(0)
    track(fleet, 12.0, ground)
    assert fleet.mode(0) is FlightMode.LANDED
    assert fleet.state.asleep[0]
    assert [k for k, _ in kinds(fleet)] == ["touch_down", "mode"]


@pytest.mark.parametrize("error", [(1.1, 0.4, 1.7), (0.8, -0.8, 0.0)])
def test_a_touch_down_that_shakes_the_estimate_is_a_landing(error):
    """The shock of it leaves speeds off by a metre a second until a sensor corrects them."""
    ground = slope(8)
    fleet = in_air((3, 2, float(ground.height(3, 2)) + 4.0))
    fleet.land(0)
    while not fleet.state.on_ground[0]:
        fleet.advance(1, ground.grid)
    zero = np.zeros((1, 3))
    shaken = EstimationError(zero, np.array([error]), np.array([LEVEL]), zero)
    fleet.set_estimation_error(np.array([0]), shaken)
    _, _, tilt = track(fleet, 8.0, ground)
    assert np.degrees(tilt.max()) < 20.0
    assert fleet.mode(0) is FlightMode.LANDED
    assert [k for k, _ in kinds(fleet)] == ["touch_down", "mode"]


@pytest.mark.parametrize(
    ("speed", "sink", "lowest"), [(2.0, 0.0, 0.4), (5.0, 0.0, 0.4), (5.0, 0.8, 0.3)]
)
def test_a_landing_in_motion_brakes_before_it_descends(speed, sink, lowest):
    """As PX4 does (its pull request 9804); 0.6 m up, a descent would end at cruise speed."""
    fleet = in_air((0.0, 0.0, 0.6))
    for _ in range(30):
        fleet.command_velocity_map(0, (speed, 0, 0))
        track(fleet, 0.1)
    if sink:
        fleet.command_velocity_map(0, (speed, 0, -sink))
        track(fleet, 0.2)
    fleet.land(0)
    position, velocity, _ = track(fleet, 8.0)
    level = np.linalg.norm(velocity[:, :2], axis=1)
    assert position[level > 0.5, 2].min() > lowest
    assert level.min() < 0.1
    assert kinds(fleet) == [("touch_down", "LAND"), ("mode", "LANDED")]


def test_a_uav_that_the_wind_carries_away_descends_all_the_same():
    wind = (25.0, 0.0, 0.0)
    fleet = in_air((0.0, 0.0, 6.0))
    track(fleet, 8.0, wind=wind)
    fleet.land(0)
    position, velocity, _ = track(fleet, 14.0, wind=wind)
    assert velocity[:, 0].min() > 2.0
    assert position[500, 2] > 5.9
    assert position[-1, 2] < 4.0


def test_low_level_hands_over_smoothly():
    fleet = in_air()
    fleet.command_attitude(0, rotations.from_rpy(0, 0.1, 0), F450.weight)
    fleet.advance(800, FLAT.grid)
    fleet.hold(0)
    _, _, tilt = track(fleet, 5.0)
    assert tilt.max() < 0.5
    assert np.linalg.norm(fleet.state.velocity_map[0]) < 0.05


# --------------------------------------------------------------------------------------- refusals


@pytest.mark.parametrize(
    ("method", "arguments", "words"),
    [
        ("command_rotor_speeds", ([NAN, 1, 1, 1],), "not finite"),
        ("command_rotor_speeds", ([1, 1, 1],), "shape"),
        ("command_rotor_speeds", ([1, 1, 1, -1],), "0 to 1100"),
        ("command_rotor_speeds", ([1, 1, 1, 1101],), "0 to 1100"),
        ("command_rates", ((0, INF, 0), 20), "not finite"),
        ("command_rates", ((0, 99, 0), 20), "out of range"),
        ("command_rates", ((0, 0, 0), -1), "thrust"),
        ("command_rates", ((0, 0, 0), 50), "thrust"),
        ("command_attitude", ((0, 0, 0, 0), 20), "unit quaternion"),
        ("command_attitude", ((0, 0, 0, NAN), 20), "not finite"),
        ("command_velocity_body", ((0, 0, NAN),), "velocity"),
        ("command_velocity_body", ((0, 0, 0), NAN), "yaw rate"),
        ("command_velocity_map", ((0, 0),), "shape"),
        ("command_velocity_map", ("fast",), "numbers"),
        ("command_velocity_map", ((1e9, 0, 0),), "out of range"),
        ("command_position", ((0, 0, INF),), "position"),
        ("command_position", ((0, 0, 1e9),), "out of range"),
        ("command_position", ((0, 0, 1), NAN), "yaw"),
        ("take_off", (5.0,), "is flying"),
        ("return_home", (-1.0,), "return height"),
    ],
)
def test_bad_commands_change_nothing(method, arguments, words):
    fleet = in_air()
    before = fleet.get_state()["uavs"].tobytes()
    with pytest.raises(CommandError, match=words):
        getattr(fleet, method)(0, *arguments)
    assert fleet.get_state()["uavs"].tobytes() == before


def test_on_the_ground_only_take_off_is_taken():
    fleet = on_ground()
    for command in (
        lambda: fleet.command_velocity_body(0, (1, 0, 0)),
        lambda: fleet.command_position(0, (1, 0, 1)),
        lambda: fleet.hold(0),
        lambda: fleet.land(0),
        lambda: fleet.return_home(0),
    ):
        with pytest.raises(CommandError, match=r"take off first|on the ground already"):
            command()
    with pytest.raises(CommandError, match="altitude"):
        fleet.take_off(0, NAN)


def test_unknown_row_and_wreck():
    fleet = in_air()
    with pytest.raises(CommandError, match="no UAV 3"):
        fleet.hold(3)
    fleet.crash(0)
    with pytest.raises(CommandError, match="crashed"):
        fleet.command_rotor_speeds(0, [0] * 4)


def test_bad_fleets():
    with pytest.raises(CommandError, match="at least one"):
        Fleet([], np.zeros((0, 3)), np.zeros((0, 4)))
    with pytest.raises(CommandError, match="not finite"):
        Fleet([F450], [[0, 0, NAN]], [LEVEL])
    with pytest.raises(CommandError, match="unit quaternion"):
        Fleet([F450], [[0, 0, 0]], [[0, 0, 0, 0.5]])
    with pytest.raises(CommandError, match="dt_ns"):
        Fleet([F450], [[0, 0, 0]], [LEVEL], dt_ns=10_000_000)
    with pytest.raises(CommandError, match="HOLD or LANDED"):
        Fleet([F450], [[0, 0, 0]], [LEVEL], mode=FlightMode.LAND)


# ----------------------------------------------------------------------------------------- ground


@pytest.mark.parametrize("degrees", [0, 10, 20, 30])
def test_stands_on_slopes_without_creeping(degrees):
    ground = slope(degrees)
    fleet = on_ground(3, 2, 0.5, ground)
    fleet.command_rotor_speeds(0, [1e-3] * 4)  # keeps it awake
    fleet.advance(500, ground.grid)
    position = fleet.state.position_map[0].copy()
    fleet.advance(3000, ground.grid)
    assert not fleet.state.asleep[0]
    assert np.linalg.norm(fleet.state.position_map[0] - position) / 3.0 < 1e-5
    assert np.linalg.norm(fleet.state.acceleration_map[0]) < 0.05  # an IMU at rest reads gravity


def test_standing_pose_touches_with_its_feet():
    ground = slope(20)
    pose = standing_pose(F450, ground, 1.0, -2.0, 1.0)
    feet = pose[:3] + rotations.rotate(pose[3:], np.array(F450.ground.feet_m))
    gaps = feet[:, 2] - ground.height(feet[:, 0], feet[:, 1])
    np.testing.assert_allclose(gaps, 0.0, atol=1e-9)


@pytest.mark.parametrize("speed", [3.0, 25.0, 60.0])
@pytest.mark.parametrize("on_contact", ["crash", "bounce"])
def test_impact(speed, on_contact):
    fleet = in_air((0, 0, 10.0), on_contact=on_contact)
    fleet.command_rotor_speeds(0, [0] * 4)
    fleet.state.velocity_map[0] = (0, 0, -speed)
    position, _, _ = track(fleet, 6.0, every=1)
    impact = next(e for e in fleet.drain_events() if e.kind is FleetEventKind.IMPACT)
    assert impact.uav == 0
    assert impact.speed_m_s > 0.85 * speed  # the air brakes it
    assert impact.position_map[2] < 0.2
    assert position[impact.step - 1, 2] == pytest.approx(impact.position_map[2])
    assert position[:, 2].min() > 0.0
    assert fleet.state.crashed[0] == (on_contact == "crash")
    if on_contact == "crash":
        assert fleet.mode(0) is FlightMode.CRASHED
        assert fleet.state.asleep[0]
        assert not fleet.state.rotor_speed[0].any()


def test_tilted_touch_is_an_impact():
    fleet = Fleet([F450], [[0, 0, 0.5]], [rotations.from_rpy(np.pi / 2, 0, 0)])
    fleet.command_rotor_speeds(0, [0] * 4)
    fleet.advance(400, FLAT.grid)
    assert ("impact", "LOW_LEVEL") in kinds(fleet)


@pytest.mark.parametrize("on_contact", ["crash", "bounce"])
def test_nothing_falls_through_rough_ground(on_contact):
    rng = np.random.default_rng(4)
    ground = Terrain.from_heights(rng.uniform(0, 4, (41, 41)), 5.0, (-100.0, -100.0))
    count = 30
    position = np.column_stack([rng.uniform(-60, 60, (count, 2)), np.full(count, 15.0)])
    attitude = rotations.normalize(rng.normal(size=(count, 4)))
    fleet = Fleet([F450] * count, position, attitude, on_contact=on_contact)
    for i in range(count):
        fleet.command_rotor_speeds(i, [0] * 4)
    direction = rng.normal(size=(count, 3))
    direction[:, 2] = -np.abs(direction[:, 2]) - 0.5
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    fleet.state.velocity_map[:] = direction * rng.uniform(10, 60, (count, 1))
    fleet.state.omega_body[:] = rng.normal(size=(count, 3)) * 10
    points = contact_points(F450)
    for _ in range(500):
        fleet.advance(6, ground.grid)
        turn = rotations.matrix(fleet.state.attitude)
        world = np.einsum("nij,pj->npi", turn, points) + fleet.state.position_map[:, None]
        gap = world[..., 2] - ground.height(world[..., 0], world[..., 1])
        assert gap.min() > -0.06  # the path of one step
    impacts = {e.uav for e in fleet.drain_events() if e.kind is FleetEventKind.IMPACT}
    assert impacts == set(range(count))


def test_strike_turns_back_and_spins():
    fleet = in_air()
    fleet.state.velocity_map[0] = (10, 1, 0)
    point = fleet.state.position_map[0] + [0.3, 0.1, 0.0]
    size = fleet.strike(0, (-1, 0, 0), 0.5, 0.3, point_map=point)
    assert size > 0.0
    omega, lever = fleet.state.omega_body[0], np.array([0.3, 0.1, 0.0])
    at_point = fleet.state.velocity_map[0] + np.cross(omega, lever)
    assert at_point[0] == pytest.approx(-5.0, abs=1.0)  # friction shares the turn
    assert np.linalg.norm(omega) > 1.0
    assert fleet.strike(0, (-1, 0, 0), 0.5, 0.3, point_map=point) == 0.0  # they part already


def test_pair_strike_keeps_momentum():
    fleet = Fleet([F450, ring(6, mass_kg=3.0)], [[0, 0, 50], [0.6, 0, 50]], [LEVEL] * 2)
    masses = np.array([[F450.body.mass_kg], [3.0]])
    fleet.state.velocity_map[:] = [[8, 1, 0], [-4, 0, 1]]
    before = (masses * fleet.state.velocity_map).sum(axis=0)
    fleet.strike(0, (-1, 0, 0), 0.3, 0.5, other=1)
    after = (masses * fleet.state.velocity_map).sum(axis=0)
    np.testing.assert_allclose(after, before, atol=1e-12)
    parting = fleet.state.velocity_map[1, 0] - fleet.state.velocity_map[0, 0]
    assert parting == pytest.approx(0.3 * 12)


def test_crash_in_the_air_falls_and_rests():
    fleet = in_air((0, 0, 20.0))
    fleet.crash(0)
    assert fleet.mode(0) is FlightMode.CRASHED
    _, velocity, _ = track(fleet, 8.0)
    assert velocity[:, 2].min() < -12.0
    assert fleet.state.asleep[0]
    before = fleet.state.position_map[0].copy()
    fleet.set_weather(Weather((10.0, 0.0, 0.0)))
    fleet.advance(2000, FLAT.grid)
    np.testing.assert_array_equal(fleet.state.position_map[0], before)
    assert kinds(fleet) == []


# -------------------------------------------------------------------------------- time and budgets


STORM = Weather(
    (2.0, 1.0, 0.0),
    LogProfile(roughness_m=0.1),
    w20_m_s=15.0,
    gusts=(Gust((3.0, -2.0, 1.0), 0.5, 0.2, 1.3), Gust((0.0, 4.0, 0.0), 0.9, 0.4)),
)


def busy_fleet():
    """UAVs in every mode, some about to hit the ground, in a storm."""
    ground = slope(12)
    z = [30.0, 30.0, 30.0, 30.0, 30.0]
    fleet = Fleet(
        [F450, ring(6), F450, ring(8), F450],
        [[6.0 * i, 3.0, float(ground.height(6.0 * i, 3.0)) + z[i]] for i in range(5)],
        [rotations.from_rpy(0, 0, 0.3 * i) for i in range(5)],
        weather=STORM,
    )
    fleet.command_position(0, (10, 20, 60), yaw=1.0)
    fleet.command_velocity_body(1, (4, 1, 0), 0.4)
    fleet.command_rates(2, (1, 2, 0.3), 8.0)
    fleet.land(3)
    fleet.crash(4)
    return fleet, ground


def test_slicing_changes_nothing():
    """Bit for bit: states, histories and events, contacts included."""
    whole, ground = busy_fleet()
    assert whole.advance(4000, ground.grid) == 4000
    sliced, _ = busy_fleet()
    rng = np.random.default_rng(0)
    while sliced.step < 4000:
        slice_ = min(int(rng.choice([1, 2, 3, 5, 7, 25, 100])), 4000 - sliced.step)
        assert sliced.advance(slice_, ground.grid) == slice_
    assert whole.get_state()["uavs"].tobytes() == sliced.get_state()["uavs"].tobytes()
    np.testing.assert_array_equal(whole.history.position, sliced.history.position)
    np.testing.assert_array_equal(whole.history.attitude, sliced.history.attitude)
    events = whole.drain_events()
    assert events == sliced.drain_events()
    assert {e.kind for e in events} == {"impact", "mode"}


def test_a_uav_flies_alike_in_company():
    many, ground = busy_fleet()
    many.advance(1500, ground.grid)
    position = busy_fleet()[0].state.position_map[:1]
    alone = Fleet([F450], position, [LEVEL], weather=STORM)
    alone.command_position(0, (10, 20, 60), yaw=1.0)
    alone.advance(1500, ground.grid)
    for name in ("position_map", "velocity_map", "attitude", "rotor_speed", "air_velocity_map"):
        np.testing.assert_array_equal(
            getattr(alone.state, name)[0], getattr(many.state, name)[0], name
        )


def test_snapshot_returns_exactly():
    fleet, ground = busy_fleet()
    fleet.advance(700, ground.grid)
    kept = fleet.get_state()
    view = fleet.state.position_map
    fleet.advance(900, ground.grid)
    wanted = fleet.get_state()
    fleet.set_state(kept)
    assert fleet.step == 700
    fleet.advance(900, ground.grid)
    assert fleet.get_state()["uavs"].tobytes() == wanted["uavs"].tobytes()
    assert fleet.drain_events() == wanted["events"]
    np.testing.assert_array_equal(view, fleet.state.position_map)


@pytest.mark.parametrize("budget", ["contact_budget", "separation_budget"])
def test_budgets_stop_after_a_whole_step(budget):
    fleet = Fleet([F450] * 2, [[0, 0, 50], [9, 0, 50]], [LEVEL] * 2)
    fleet.state.velocity_map[:] = (10, 0, 0)
    for i in (0, 1):
        fleet.command_rotor_speeds(i, [770] * 4)
    getattr(fleet.state, budget)[1] = 0.5
    start = fleet.state.position_map.copy()
    done = fleet.advance(1000, FLAT.grid)
    assert 0 < done < 45  # at the guidance tick before
    assert fleet.step == done
    assert fleet.s_to_next_tick == 0.008
    while getattr(fleet.state, budget)[1] > 0.0:
        done += fleet.advance(1000, FLAT.grid)
    assert 45 < done < 60
    assert fleet.step == done
    flown = np.linalg.norm(fleet.state.position_map - start, axis=1)
    assert flown[0] == pytest.approx(flown[1], rel=1e-6)
    assert 0.48 < flown[1] < 0.52
    getattr(fleet.state, budget)[1] = np.inf
    assert fleet.advance(100, FLAT.grid) == 100


def test_records_have_no_hidden_padding():
    for record in (BODY, CONTROL_STATE, UAV):
        assert record.itemsize == sum(kind.itemsize for kind, _ in record.fields.values())


def test_history_holds_every_step():
    fleet = in_air()
    fleet.command_velocity_map(0, (5, 0, 0))
    seen = [fleet.state.position_map[0].copy()]
    for _ in range(50):
        fleet.advance(1, FLAT.grid)
        seen.append(fleet.state.position_map[0].copy())
    np.testing.assert_array_equal(fleet.history.position[:51, 0], seen)
    assert fleet.history.dt_ns == 1_000_000
    np.testing.assert_array_equal(fleet.history.attitude[50, 0], fleet.state.attitude[0])


def test_state_rows_are_the_states_of_their_uavs():
    fleet = Fleet([F450] * 3, [[0, 0, 50], [5, 0, 60], [0, 9, 70]], [LEVEL] * 3)
    fleet.command_position(1, (5, 5, 60))
    fleet.advance(800, FLAT.grid)
    np.testing.assert_allclose(
        fleet.state.position_map[[0, 2]], [[0, 0, 50], [0, 9, 70]], atol=1e-9
    )
    assert fleet.state.position_map[1, 1] > 0.5
    assert fleet.state.acceleration_map.shape == (3, 3)
    assert len(fleet) == 3
