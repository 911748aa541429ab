"""Cameras see the blades of other UAVs where their rotors have turned to."""

import numpy as np
import pytest

from volery.core import rotations
from volery.sensors.cameras.camera import take
from volery.sensors.cameras.light import make_light
from volery.sensors.cameras.model import CameraModel
from volery.sensors.lidar.lidar import make_batch, stack_mounts
from volery.sensors.mount import make_mount
from volery.vehicle.airframe import load_airframe
from volery.vehicle.body_shape import body_shape
from volery.vehicle.fleet import RotorTurns
from volery.vehicle.pose_history import new_history
from volery.world.materials import Material
from volery.world.scene import Scene
from volery.world.terrain import Terrain

AIRFRAME = load_airframe("f450")
RADIUS = AIRFRAME.rotors.radius_m
HEIGHT = AIRFRAME.rotors.places[0].position_m[2]
ABOVE = 2.0
"""m from the camera down to the plane of the rotors."""
DOWN = CameraModel(width=400, height=400, horizontal_fov_deg=24.0)
PIXEL = ABOVE / DOWN.focal_px
NOON = make_light(sun_elevation_deg=90.0)


@pytest.fixture
def from_above():
    """An image of a level F450 straight below the camera: columns are to the right, -y."""
    scene = Scene(Terrain.flat(200.0, origin=(-100.0, -100.0)), None)
    scene.set_bodies([body_shape(AIRFRAME)], [0, 0])

    def shoot(angle=None, speed=0.0, model=DOWN, light=NOON, up=20.0, **options):
        attitude = [rotations.from_rpy(0.0, np.pi / 2, 0.0), rotations.IDENTITY]
        positions = [[0.0, 0.0, up], [0.0, 0.0, up - ABOVE - HEIGHT]]
        history = new_history(positions, attitude, 1_000_000)
        batch = make_batch([0], [0], [0], [0], [0], stack_mounts([make_mount()]))
        turns = None
        if angle is not None:
            turns = RotorTurns(np.full((2, 12), angle), np.full((2, 12), speed), 0)
        return take(scene, model, light, batch, history, rotors=turns, **options)

    yield shoot
    scene.close()


def rotor_pixels(seen, rotor):
    """Where a rotor is seen, as (x, y) m from its centre."""
    rows, columns = np.nonzero(seen.material[0] == Material.ROTOR)
    x, y = (199.5 - rows) * PIXEL, (199.5 - columns) * PIXEL
    dx, dy = x - rotor.position_m[0], y - rotor.position_m[1]
    near = np.hypot(dx, dy) < 1.05 * RADIUS
    return dx[near], dy[near]


def direction(dx, dy):
    """Angle of the main axis of points, rad, from -pi/2 to pi/2."""
    values, vectors = np.linalg.eigh(np.cov(dx, dy))
    assert values[1] > 10.0 * values[0]
    return np.arctan(vectors[1, 1] / vectors[0, 1])


@pytest.mark.parametrize("angle", [0.0, 0.4, 2.0])
def test_blades_lie_at_the_angle_of_the_rotor(from_above, angle):
    """Each rotor by its sense of rotation, from where it stands at angle 0."""
    still, turned = from_above(0.0), from_above(angle)
    for rotor in AIRFRAME.rotors.places:
        sense = 1.0 if rotor.direction == "ccw" else -1.0
        begun, now = (direction(*rotor_pixels(seen, rotor)) for seen in (still, turned))
        off = (now - begun - sense * angle + np.pi / 2) % np.pi - np.pi / 2
        assert abs(off) < 0.03


def test_blades_reach_to_the_tip_and_fill_a_tenth_of_the_disc(from_above):
    rotor = AIRFRAME.rotors.places[0]
    discs, blades = (rotor_pixels(from_above(angle), rotor) for angle in (None, 0.7))
    fraction = len(blades[0]) / len(discs[0])
    # By the shape: (mean chord x 2 blades x length + hub) / disc, arms below hide nothing.
    assert fraction == pytest.approx(
        (2 * 0.16 - 2 * 0.12 * 0.214 + np.pi * 0.12**2) / np.pi, rel=0.1
    )
    assert np.hypot(*blades).max() == pytest.approx(RADIUS, abs=2 * PIXEL)


def test_what_is_below_is_seen_between_the_blades(from_above):
    discs, blades = from_above(), from_above(1.1)
    opened = (discs.material[0] == Material.ROTOR) & (blades.material[0] != Material.ROTOR)
    below = blades.material[0][opened]
    arms = {Material.UAV_RED, Material.UAV_WHITE}
    assert set(np.unique(below)) >= {Material.GROUND, Material.UAV_GREY} | arms
    ground = below == Material.GROUND
    depth = blades.depth[0][opened]
    np.testing.assert_allclose(depth[ground], 20.0, atol=1e-3)
    assert (np.abs(depth[~ground] - ABOVE - HEIGHT / 2.0) < HEIGHT).all()
    same = discs.material[0] == blades.material[0]
    assert (opened | same).all()


def test_blades_turn_while_a_rolling_shutter_reads(from_above):
    """Each tile of four rows is that of a still image at its own time."""
    model = DOWN.model_copy(update={"readout_s": 0.02})
    rate = np.pi / 0.02  # half a turn
    seen = from_above(0.3, rate, model=model, parts=("labels",)).material[0]
    for row in (120, 200, 280):
        fraction = (row + 1.5) / 399
        tile = slice(row, row + 4)
        still = from_above(0.3 + np.pi * fraction, parts=("labels",)).material[0]
        begun = from_above(0.3, parts=("labels",)).material[0]
        assert (seen[tile] != still[tile]).sum() <= 8
        if (still[tile] == Material.ROTOR).any():
            assert (seen[tile] != begun[tile]).sum() > 20


def test_blades_throw_their_shadow(from_above):
    """The sun 45 degrees high, the UAV 1.2 m above ground: its shadow falls beside it."""
    wide = CameraModel(width=200, height=200, horizontal_fov_deg=90.0)
    east = make_light(sun_elevation_deg=45.0, sun_azimuth_deg=90.0)

    def shaded(angle, up=ABOVE + HEIGHT + 1.2):
        seen = from_above(angle, model=wide, light=east, up=up)
        bright = seen.colour[0].astype(int).sum(axis=-1)
        return (seen.material[0] == Material.GROUND) & (bright < 0.8 * np.median(bright))

    discs, blades = shaded(None), shaded(0.3)
    rotors = 4 * np.pi * (RADIUS * wide.focal_px / (ABOVE + HEIGHT + 1.2)) ** 2
    assert discs.sum() - blades.sum() > 0.6 * rotors
    assert blades.sum() > 0.1 * rotors  # body, arms and blades


def test_rotors_turn_by_their_speed_however_a_run_is_sliced(simulate):
    data = {
        "name": "turning",
        "types": {"f450": {"sensors": [{"kind": "imu"}]}},
        "uavs": [{"type": "f450", "position_m": [0.0, 0.0, 20.0]}],
    }
    one, other = simulate(data), simulate(data)
    speeds = []
    for _ in range(200):
        one.step(1)
        speeds.append(one.uavs["uav1"].rotor_speed)
    other.step(200)
    turns = [s._engine.fleet.rotor_turns() for s in (one, other)]
    np.testing.assert_array_equal(turns[0].angle, turns[1].angle)
    now = one.time_ns
    turned = turns[0].at(now)[0, :4]
    np.testing.assert_allclose(turned, np.sum(speeds, axis=0) * 1e-3, rtol=0.005)
    assert turned.min() > 100.0


def test_a_camera_of_a_simulation_sees_blades(simulate):
    """Two images of a hovering UAV differ in its rotors, and show much behind them."""
    camera = {"kind": "camera", "rpy_deg": [0.0, 90.0, 0.0], "noise": False}
    camera |= {"width": 160, "height": 160, "horizontal_fov_deg": 40.0}
    data = {
        "name": "above",
        "types": {"seer": {"sensors": [camera]}, "seen": {}},
        "uavs": [
            {"type": "seer", "position_m": [0.0, 0.0, 23.0]},
            {"type": "seen", "position_m": [0.0, 0.0, 20.0]},
        ],
    }
    simulation = simulate(data)
    images = []
    simulation.graph.subscribe(
        "/uav1/camera/labels/material",
        lambda m: images.append(np.asarray(m.message.data).reshape(160, 160) == Material.ROTOR),
    )
    simulation.run(0.35)
    discs = 4 * np.pi * (RADIUS * 160 / (2 * np.tan(np.radians(20.0))) / 2.9) ** 2
    for image in images:
        assert 0.04 * discs < image.sum() < 0.3 * discs
    assert (images[1] & ~images[2]).sum() > 0.3 * images[1].sum()
