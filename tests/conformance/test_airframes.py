"""What every airframe must do: those that ship, whichever they are, and a user's own kinds.

A new vehicle joins by its file in the folder. Tolerances are in the vehicle's own measures.
"""

import math

import numpy as np
import pytest
from standing import standing_pose

from volery.control.fleet import Fleet
from volery.control.fleet_events import FleetEventKind
from volery.control.flight_modes import FlightMode
from volery.core import rotations
from volery.vehicle.airframe import Airframe, airframe_names, hover_thrusts, load_airframe
from volery.vehicle.plant import contact_points
from volery.world.terrain import Terrain
from volery.world.weather import Weather

FLAT = Terrain.flat(1000.0, 0.0, (-500.0, -500.0))


def own(name, rotor_places, **rotors) -> Airframe:
    """A user's vehicle: an F450's body with other rotors."""
    data = load_airframe("f450").model_dump()
    data |= {"name": name, "title": name, "battery": None}
    data["body"]["collision_radius_m"] = 0.6
    data["rotors"] |= {"places": rotor_places, **rotors}
    return Airframe.model_validate(data)


def around(count):
    return (np.arange(count) + 0.5) * 2 * np.pi / count


def hexarotor():
    rotor_places = [
        {
            "position_m": (0.3 * math.cos(a), 0.3 * math.sin(a), 0.05),
            "direction": "ccw" if k % 2 else "cw",
        }
        for k, a in enumerate(around(6))
    ]
    return own("hexarotor", rotor_places)


def tilted_hexarotor():
    """Rotors that lean 20 degrees to one side and the other in turn, at two heights."""
    lean = math.radians(20.0)
    rotor_places = [
        {
            "position_m": (0.3 * math.cos(a), 0.3 * math.sin(a), 0.05 + 0.03 * (k % 2)),
            "direction": "ccw" if k % 2 else "cw",
            "axis": (
                -math.sin(a) * math.sin(lean) * (-1) ** k,
                math.cos(a) * math.sin(lean) * (-1) ** k,
                math.cos(lean),
            ),
        }
        for k, a in enumerate(around(6))
    ]
    return own("tilted_hexarotor", rotor_places)


def octo_x8():
    """Four arms, on each an upper and a lower rotor that turn against each other."""
    rotor_places = []
    for k, a in enumerate(around(4)):
        x, y = 0.28 * math.cos(a), 0.28 * math.sin(a)
        for z, upper in ((0.06, True), (-0.02, False)):
            left = upper == bool(k % 2)
            rotor_places.append({"position_m": (x, y, z), "direction": "ccw" if left else "cw"})
    return own("octo_x8", rotor_places, thrust_n_s2=5.0e-6)


VEHICLES = {name: load_airframe(name) for name in airframe_names()}
VEHICLES |= {make.__name__: make() for make in (hexarotor, tilted_hexarotor, octo_x8)}
every_airframe = pytest.mark.parametrize("airframe", VEHICLES.values(), ids=VEHICLES.keys())


def on_ground(airframe, count=1):
    poses = [standing_pose(airframe, FLAT, 5.0 * i, 0.0, 0.4) for i in range(count)]
    return Fleet(
        [airframe] * count,
        [pose[:3] for pose in poses],
        [pose[3:] for pose in poses],
        mode=FlightMode.LANDED,
    )


def height_and_distance(airframe):
    """A height and a distance, m, that take some seconds at the vehicle's own speeds."""
    return 3.0 * airframe.limits.take_off_m_s, 4.0 * airframe.limits.speed_m_s**0.5


@every_airframe
def test_takes_off_flies_to_a_position_comes_back_and_lands(airframe):
    height, distance = height_and_distance(airframe)
    fleet = on_ground(airframe)
    start = fleet.state.position_map[0].copy()
    fleet.advance(500, FLAT.grid)
    np.testing.assert_allclose(fleet.state.position_map[0], start, atol=1e-4)

    fleet.take_off(0, height)
    fleet.advance(9000, FLAT.grid)
    assert fleet.mode(0) is FlightMode.HOLD
    above = start + np.array([0, 0, height])
    np.testing.assert_allclose(fleet.state.position_map[0], above, atol=0.05)

    goal = above + np.array([distance, 0.5 * distance, 0])
    fleet.command_position(0, goal, yaw=-1.0)
    fleet.advance(14_000, FLAT.grid)
    assert fleet.mode(0) is FlightMode.HOLD
    np.testing.assert_allclose(fleet.state.position_map[0], goal, atol=0.05)
    assert float(rotations.yaw_of(fleet.state.attitude[0])) == pytest.approx(-1.0, abs=0.02)

    fleet.land(0)
    fleet.advance(round(1000 * (6.0 + height / airframe.limits.landing_m_s)), FLAT.grid)
    assert fleet.mode(0) is FlightMode.LANDED
    assert not fleet.state.rotor_speed[0].any()
    np.testing.assert_allclose(fleet.state.position_map[0, :2], goal[:2], atol=0.1)
    up = 1 - 2 * (fleet.state.attitude[0, :2] ** 2).sum()
    assert up > math.cos(math.radians(2.0))
    kinds = [event.kind for event in fleet.drain_events()]
    assert FleetEventKind.TOUCH_DOWN in kinds
    assert FleetEventKind.IMPACT not in kinds


@every_airframe
def test_hovers_still_also_in_wind(airframe):
    """Within 5 cm after a gust has pushed it; the wind is a quarter of its speed limit."""
    fleet = Fleet([airframe], [[0, 0, 20.0]], [[0, 0, 0, 1.0]])
    fleet.advance(3000, FLAT.grid)
    np.testing.assert_allclose(fleet.state.position_map[0], [0, 0, 20], atol=1e-3)
    fleet.set_weather(Weather((0.25 * airframe.limits.speed_m_s, 0.0, 0.0)))
    fleet.advance(15_000, FLAT.grid)
    np.testing.assert_allclose(fleet.state.position_map[0], [0, 0, 20], atol=0.05)
    assert np.linalg.norm(fleet.state.velocity_map[0]) < 0.02


@every_airframe
def test_numbers_are_sane(airframe):
    thrusts, rotors = hover_thrusts(airframe), airframe.rotors
    throttle = np.sqrt(thrusts / rotors.thrust_n_s2) / rotors.max_speed_rad_s
    assert (throttle > 0.3).all()
    assert (throttle < 0.85).all()
    points = contact_points(airframe)
    feet = len(airframe.ground.feet_m)
    assert points[:feet, 2].max() < points[feet:, 2].min()  # it stands on its feet
    assert np.linalg.norm(points, axis=1).max() <= airframe.body.collision_radius_m + 0.02
    density = airframe.body.mass_kg / np.prod(airframe.body.size_m)
    assert 50.0 < density < 3000.0
    # no mass beyond the collision sphere: I <= m r^2
    radius = airframe.body.collision_radius_m
    assert max(airframe.body.inertia_kg_m2) < airframe.body.mass_kg * radius**2


def flown(airframe, slices):
    fleet = on_ground(airframe, 2)
    fleet.set_weather(Weather((0.5, 0.2, 0.0)))
    for i in (0, 1):
        fleet.take_off(i, 1.0)
    for steps in slices:
        fleet.advance(steps, FLAT.grid)
        if fleet.step == 3000:
            fleet.command_position(0, [3.0, 1.0, 1.5])
            fleet.land(1)
    return fleet


@every_airframe
def test_is_deterministic_and_independent_of_slicing(airframe):
    whole = flown(airframe, [3000, 2000])
    again = flown(airframe, [3000, 2000])
    cut = flown(airframe, [1, 2, 997, 13, 1987, 5, 5, 1990])
    for other in (again, cut):
        assert whole.get_state()["uavs"].tobytes() == other.get_state()["uavs"].tobytes()
    assert whole.drain_events() == cut.drain_events()


@every_airframe
def test_a_snapshot_returns_exactly(airframe):
    fleet = flown(airframe, [3000, 500])
    fleet.set_rotor_health(0, 1, 0.9)
    fleet.advance(50, FLAT.grid)
    kept = fleet.get_state()
    fleet.advance(700, FLAT.grid)
    wanted = fleet.get_state()["uavs"].tobytes()
    fleet.set_state(kept)
    fleet.advance(700, FLAT.grid)
    assert fleet.get_state()["uavs"].tobytes() == wanted
