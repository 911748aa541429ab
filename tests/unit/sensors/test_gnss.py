"""GNSS: delay, units, noise, and fixes lost and found."""

import math

import numpy as np
import pytest
from navigation_bench import NS, ZURICH, fleet_of, gnss_bank, keys_of, put

from volery.core import rotations
from volery.core.errors import CommandError, DataFileError, ScenarioError
from volery.scenario.load import parse_scenario
from volery.sensors.gnss import GnssModel
from volery.sensors.gnss_denial import GnssDenial, Prism

PERIOD = NS // 5


def fly(simulate, data, *, gnss, world=None, seconds=3.0, rate_hz=1000):
    """Fixes, velocities and true odometry of each physics step of a UAV that flies east."""
    data["physics"] = {"rate_hz": rate_hz}
    data["types"]["f450"]["sensors"] = [
        {"kind": "gnss", **gnss},
        {"kind": "ground_truth", "rate_hz": min(rate_hz, 1000)},
    ]
    data["world"] = world or {}
    data["uavs"][0]["position_m"] = [0.0, 0.0, 5.0]
    simulation = simulate(data)
    got = {"fix": [], "fix_velocity": [], "ground_truth/odom": []}
    for topic, messages in got.items():
        simulation.graph.subscribe(f"/uav1/{topic}", messages.append)
    simulation.uavs["uav1"].go_to([30.0, 5.0, 8.0])
    simulation.run(seconds)
    return got.values()


def stamp(message):
    return message.header.stamp.sec * NS + message.header.stamp.nanosec


def position_of(fix):
    return ZURICH.enu_from_geodetic([*np.radians([fix.latitude, fix.longitude]), fix.altitude])


def vector(v):
    return np.array([v.x, v.y, v.z])


@pytest.mark.parametrize("rate_hz", [200, 500, 1000, 4000])
def test_a_fix_is_the_position_of_120_ms_ago(simulate, flat_data, rate_hz):
    """At the slower rates the history of poses reaches back least, counted in steps."""
    gnss = {"noise": False}
    fixes, velocities, truth = fly(simulate, flat_data, gnss=gnss, rate_hz=rate_hz)
    true = {stamp(m.message): m.message for m in truth}
    assert [m.time_ns for m in fixes] == [120_000_000 + k * PERIOD for k in range(15)]
    assert [stamp(m.message) for m in fixes] == [k * PERIOD for k in range(15)]
    for fix, velocity in zip(fixes, velocities, strict=True):
        assert stamp(velocity.message) == stamp(fix.message)
        before = true[stamp(fix.message)]
        position = vector(before.pose.pose.position)
        np.testing.assert_allclose(position_of(fix.message), position, atol=1e-6)
        q = before.pose.pose.orientation
        moving = rotations.rotate([q.x, q.y, q.z, q.w], vector(before.twist.twist.linear))
        measured = vector(velocity.message.twist.twist.linear)
        np.testing.assert_allclose(measured, moving, atol=8.0 / rate_hz)
    assert np.linalg.norm(measured) > 1.0
    assert velocity.message.header.frame_id == "map"
    assert fix.message.header.frame_id == "uav1/fix"


def test_instants_between_physics_steps_are_exact(simulate, flat_data):
    fixes, _, truth = fly(simulate, flat_data, gnss={"noise": False, "phase_s": 0.012_345_6})
    times = np.array([stamp(m.message) for m in truth])
    positions = np.array([vector(m.message.pose.pose.position) for m in truth])
    for k, fix in enumerate(fixes):
        instant = 12_345_600 + k * PERIOD
        assert stamp(fix.message) == instant
        assert fix.time_ns == -(-(instant + 120_000_000) // 1_000_000) * 1_000_000
        expected = [np.interp(instant, times, axis) for axis in positions.T]
        np.testing.assert_allclose(position_of(fix.message), expected, atol=1e-6)


def test_antenna_feels_its_lever():
    fleet = fleet_of()
    quarter_left = rotations.from_rpy(0.0, 0.0, math.pi / 2)
    put(fleet, [1.0, 2.0, 3.0], quarter_left)
    reading = gnss_bank(lever=(0.5, 0.0, 0.2)).sample(0, NS, fleet)
    np.testing.assert_allclose(reading.position_map, [[1.0, 2.5, 3.2]], atol=1e-12)


def test_velocity_is_that_of_the_antenna():
    """A UAV that spins on the spot moves an antenna ahead of it sideways."""
    fleet = fleet_of()
    history = fleet.history
    for row in range(len(history.position)):
        history.attitude[row] = rotations.from_rpy(0.0, 0.0, 2.0 * row * 1e-3)
    reading = gnss_bank(lever=(0.5, 0.0, 0.0)).sample(0, 50_000_000, fleet)
    expected = 2.0 * 0.5 * np.array([-math.sin(0.1), math.cos(0.1), 0.0])
    np.testing.assert_allclose(reading.velocity_map[0], expected, atol=2e-3)


@pytest.mark.parametrize("name", ["gnss_m8", "gnss_gazebo_classic"])
def test_noise_and_drift_are_as_the_model_says(name):
    model, count, fleet = GnssModel.load(name), 4000, fleet_of()
    bank = gnss_bank(count, noise=True, **model.model_dump())
    samples = [bank.sample(k, k * PERIOD, fleet) for k in range(61)]
    error = np.array([r.position_map for r in samples]) - fleet.state.position_map[0]
    sigma = np.array([model.horizontal_drift_m] * 2 + [model.vertical_drift_m])
    for k in (0, 60):  # as spread at the start as later
        np.testing.assert_allclose(error[k].std(axis=0), sigma, rtol=0.04)
    together = (error[0] * error[60]).mean(axis=0) / sigma**2
    np.testing.assert_allclose(together, math.exp(-12.0 / model.drift_correlation_s), atol=0.05)
    speed = np.array([r.velocity_map for r in samples[:10]])
    noise = [model.horizontal_velocity_noise_m_s] * 2 + [model.vertical_velocity_noise_m_s]
    np.testing.assert_allclose(speed.std(axis=(0, 1)), noise, rtol=0.03)
    np.testing.assert_allclose(samples[0].position_variance[0], sigma**2, rtol=1e-6)
    np.testing.assert_allclose(samples[0].velocity_variance[0], np.square(noise))


def test_white_noise_of_neighbouring_fixes():
    fleet = fleet_of()
    bank = gnss_bank(4000, noise=True, horizontal_drift_m=0.0, horizontal_noise_m=0.3)
    error = np.array([bank.sample(k, k * PERIOD, fleet).position_map[:, 0] for k in range(2)])
    np.testing.assert_allclose(error.std(axis=1), 0.3, rtol=0.05)
    assert abs(np.corrcoef(error)[0, 1]) < 0.06


def test_polygons_and_heights():
    hook = Prism(np.array([[0, 0], [10, 0], [10, 10], [8, 10], [8, 2], [0, 2]], float), 1.0, 5.0)
    inside = [[5, 1, 3], [9, 9, 1.0], [9, 1, 5.0]]
    outside = [[5, 5, 3], [9, 9, 0.9], [9, 9, 5.1], [11, 1, 3], [-1, 1, 3], [9, 10.5, 3]]
    assert hook.contains(np.array(inside, float)).all()
    assert not hook.contains(np.array(outside, float)).any()
    reversed_ = hook._replace(corners=hook.corners[::-1])
    assert reversed_.contains(np.array(inside, float)).all()


def test_a_uav_that_enters_an_area_loses_its_fix_and_regains_it_later():
    area = Prism(np.array([[0, 0], [20, 0], [20, 20], [0, 20]], float), 0.0, 30.0)
    bank, fleet = gnss_bank(denial=GnssDenial(prisms=(area,)), reacquisition_s=1.0), fleet_of()
    had = {}
    for k in range(25):
        put(fleet, [-5.0 if k < 5 or k >= 10 else 5.0, 10.0, 10.0])
        reading = bank.sample(k, k * PERIOD, fleet)
        had[k] = bool(reading.has_fix[0])
        assert np.isnan(reading.position_map).all() != had[k]
        assert np.isnan(reading.velocity_map).all() != had[k]
    # Denied at k = 5..9; five periods after the last of them there is a fix again.
    assert [k for k, fixed in had.items() if not fixed] == list(range(5, 14))
    put(fleet, [5.0, 10.0, 31.0])  # above the area
    assert bank.sample(25, 25 * PERIOD, fleet).has_fix[0]


def test_signals_taken_from_one_uav_for_a_while():
    bank, fleet = gnss_bank(reacquisition_s=0.4), fleet_of()
    bank.deny(0, since_ns=NS, until_ns=2 * NS)
    had = [bool(bank.sample(k, k * PERIOD, fleet).has_fix[0]) for k in range(16)]
    # Denied are k = 5..9, the next fix comes two periods after k = 9.
    assert [k for k in range(16) if not had[k]] == list(range(5, 11))
    for uav, since, until in ((1, 0, 1), (0, 5, 5)):
        with pytest.raises(CommandError):
            bank.deny(uav, since, until)


def test_a_denial_reaches_no_other_uav():
    fleet = fleet_of(2)
    bank = gnss_bank(2)
    bank._rows = np.array([0, 1])
    bank.deny(1, 0)
    np.testing.assert_array_equal(bank.sample(0, 0, fleet).has_fix, [True, False])


def test_receivers_without_noise_ignore_new_streams():
    bank = gnss_bank(2)
    fresh = bank.get_state()
    bank.reset(None, keys_of(2), 0, 0)
    np.testing.assert_equal(bank.get_state(), fresh)


def test_noise_is_the_same_after_a_loss():
    fleet = fleet_of()
    free, denied = gnss_bank(noise=True), gnss_bank(noise=True)
    denied.deny(0, NS, 2 * NS)
    for k in range(30):
        reading = denied.sample(k, k * PERIOD, fleet)
        expected = free.sample(k, k * PERIOD, fleet)
        if reading.has_fix[0]:
            np.testing.assert_array_equal(reading.position_map, expected.position_map)


def test_a_denied_world_says_so_in_its_messages(simulate, flat_data):
    fixes, velocities, _ = fly(simulate, flat_data, gnss={}, world={"gnss_denied": True})
    assert len(fixes) == 15
    assert not velocities
    for published in fixes:
        fix = published.message
        assert fix.status.status == -1
        assert fix.position_covariance_type == 0
        assert math.isnan(fix.latitude)
        assert math.isnan(fix.altitude)
        np.testing.assert_array_equal(fix.position_covariance, 0.0)


def test_an_area_of_the_scenario_denies(simulate, flat_data):
    world = {
        "gnss_denied_areas": [
            {"kind": "box", "region_m": [10.0, -50.0, 50.0, 50.0], "height_m": [0.0, 100.0]}
        ]
    }
    fixes, _, truth = fly(simulate, flat_data, gnss={}, world=world, seconds=9.0)
    x = {stamp(m.message): m.message.pose.pose.position.x for m in truth}
    lost = [m.message.status.status == -1 for m in fixes]
    assert lost == [x[stamp(m.message)] > 10.0 for m in fixes]
    assert 5 < sum(lost) < 40


def test_fix_holds_its_covariance_and_service(simulate, flat_data):
    fixes, velocities, _ = fly(simulate, flat_data, gnss={})
    model, fix = GnssModel.load("gnss_m8"), fixes[3].message
    assert (fix.status.status, fix.status.service, fix.position_covariance_type) == (0, 1, 2)
    diagonal = fix.position_covariance.reshape(3, 3).diagonal()
    np.testing.assert_allclose(diagonal[2], model.vertical_drift_m**2, rtol=1e-4)
    assert velocities[3].message.twist.covariance[0] == pytest.approx(
        model.horizontal_velocity_noise_m_s**2
    )
    assert velocities[3].message.twist.covariance[35] == -1.0


def test_origin_moves_the_fixes(simulate, flat_data):
    world = {"origin": {"latitude_deg": -33.9, "longitude_deg": 151.2, "altitude_m": 20.0}}
    fixes, _, _ = fly(simulate, flat_data, gnss={"noise": False}, world=world, seconds=0.2)
    fix = fixes[0].message
    assert (fix.latitude, fix.longitude) == pytest.approx((-33.9, 151.2), abs=1e-9)
    assert fix.altitude == pytest.approx(25.0, abs=0.01)


def test_too_late_a_receiver_is_refused():
    with pytest.raises(DataFileError, match=r"delay_s may be 0\.122 s at most, not 0\.2"):
        gnss_bank(delay_s=0.2)


@pytest.mark.parametrize(
    ("world", "message"),
    [
        ({"origin": {"latitude_deg": 91.0}}, "world.origin.latitude_deg"),
        ({"gnss_denied_areas": [{"kind": "box", "region_m": [5, 0, 1, 9]}]}, "min < max"),
        (
            {"gnss_denied_areas": [{"kind": "polygon", "corners_m": [[0, 0], [1, 1]]}]},
            "corners_m",
        ),
        (
            {"gnss_denied_areas": [{"kind": "polygon", "corners_m": [[0, 0], [1, 1], [0, 0]]}]},
            "three different corners",
        ),
        (
            {
                "gnss_denied_areas": [
                    {"kind": "box", "region_m": [0, 0, 1, 1], "height_m": [5.0, 1.0]}
                ]
            },
            "lowest < highest",
        ),
        ({"magnetic_field": {"inclination_deg": 120.0}}, "world.magnetic_field.inclination_deg"),
    ],
)
def test_wrong_worlds_are_refused(flat_data, world, message):
    flat_data["world"] = world
    with pytest.raises(ScenarioError, match=message):
        parse_scenario(flat_data)


def test_names_of_fixes_and_their_velocities_must_differ(flat_data):
    flat_data["types"]["f450"]["sensors"] = [
        {"kind": "gnss"},
        {"kind": "gnss", "name": "fix_velocity"},
    ]
    with pytest.raises(ScenarioError, match="used twice: fix_velocity"):
        parse_scenario(flat_data)


def test_other_keys_other_errors():
    fleet = fleet_of()
    one, other = gnss_bank(3, noise=True), gnss_bank(3, noise=True)
    other.reset(None, keys_of(3, first=500), 0, 0)
    a, b = (bank.sample(0, 0, fleet).position_map for bank in (one, other))
    assert (a != b).all()
