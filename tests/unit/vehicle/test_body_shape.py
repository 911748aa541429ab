"""The shape of a UAV for others' sensors: arms, motors, legs and rotors of its airframe."""

import numpy as np
import pytest

from volery.core import rotations
from volery.sensors.cameras.camera import take
from volery.sensors.cameras.light import make_light
from volery.sensors.cameras.model import CameraModel
from volery.sensors.lidar.lidar import make_batch, stack_mounts
from volery.sensors.mount import make_mount
from volery.vehicle.airframe import airframe_names, load_airframe
from volery.vehicle.body_shape import MATERIAL_OF, body_shape
from volery.vehicle.fleet import RotorTurns
from volery.vehicle.pose_history import new_history
from volery.world.materials import PROPERTIES, Material
from volery.world.scene import Scene
from volery.world.terrain import Terrain


@pytest.fixture
def scene():
    made = Scene(Terrain.flat(40.0, origin=(-20.0, -20.0)), None)
    yield made
    made.close()


@pytest.mark.parametrize("name", airframe_names())
def test_it_stands_on_its_feet_and_ends_at_its_rotors(name):
    airframe = load_airframe(name)
    shape = body_shape(airframe)
    corners = np.vstack([mesh.vertices for mesh, _ in shape.parts])
    assert corners[:, 2].min() == pytest.approx(-airframe.ground_offset, abs=1e-6)
    assert shape.radius <= airframe.body.collision_radius_m
    materials = [material for _, material in shape.parts]
    assert len(set(materials)) == len(materials)
    assert materials[-1] is Material.ROTOR
    for mesh, material in shape.parts[:-1]:
        a, b, c = np.moveaxis(mesh.corners.astype(float), 1, 0)
        volume = np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6.0
        assert volume > 0.0, material  # faces look outwards


@pytest.mark.parametrize("name", airframe_names())
def test_rays_meet_arms_motors_legs_and_battery(scene, name):
    airframe = load_airframe(name)
    scene.set_bodies([body_shape(airframe)], [0])
    scene.move_bodies([[0.0, 0.0, 10.0]], [rotations.IDENTITY])
    rotor = np.array(airframe.rotors.places[0].position_m)
    foot = np.array(airframe.ground.feet_m[0])
    radius, colours = airframe.rotors.radius_m, airframe.colours
    motor = rotor - [0.0, 0.0, 0.15 * radius]
    pad = foot + np.array([0.0, 0.0, 1e-3 * radius])
    battery = np.array([-0.04, 0.0, 0.4]) * airframe.body.size_m
    targets = np.array([motor, pad, battery]) + np.array([0.0, 0.0, 10.0])
    out = np.array([rotor[:2] / np.hypot(*rotor[:2]), foot[:2] / np.hypot(*foot[:2]), [0.0, 1.0]])
    origins = targets + 3.0 * np.column_stack([out, np.zeros(3)])
    hits = scene.cast(origins, (targets - origins) / 3.0, 10.0)
    assert (hits.instance == scene.moving_offset).all()
    assert hits.material.tolist() == [
        Material.UAV_GREY,
        MATERIAL_OF[colours.legs],
        Material.UAV_BLUE,
    ]
    assert (hits.distance < 3.0).all()
    assert (hits.distance > 2.6).all()


def test_a_camera_sees_the_colours_of_the_airframe(scene):
    """From above: red arms to the front, white ones to the back, a blue battery, nothing pink."""
    scene.set_bodies([body_shape(load_airframe("f450"))], [0, 0])
    history = new_history(
        [[0.0, 0.0, 12.0], [0.0, 0.0, 10.0]],
        [rotations.from_rpy(0.0, np.pi / 2, 0.0), rotations.IDENTITY],
        1_000_000,
    )
    batch = make_batch([0], [0], [0], [0], [0], stack_mounts([make_mount()]))
    turns = RotorTurns(np.full((2, 12), 0.4), np.zeros((2, 12)), 0)
    model = CameraModel(width=300, height=300, horizontal_fov_deg=24.0)
    light = make_light(sun_elevation_deg=90.0)
    seen = take(scene, model, light, batch, history, rotors=turns)
    material, colour = seen.material[0], seen.colour[0].astype(int)
    rows = (
        np.nonzero(material == Material.UAV_RED)[0],
        np.nonzero(material == Material.UAV_WHITE)[0],
    )
    assert len(rows[0]) > 100
    assert len(rows[1]) > 100
    assert rows[0].mean() < 130 < 170 < rows[1].mean()  # the image's top is ahead
    red = colour[material == Material.UAV_RED].mean(axis=0)
    blue = colour[material == Material.UAV_BLUE].mean(axis=0)
    assert red[0] > 2 * red[1:].max()
    assert blue[2] > 1.3 * blue[:2].max()
    dark = colour[material == Material.UAV_BODY]
    assert len(dark) > 300
    assert dark.mean() < 110
    assert (dark.max(axis=1) - dark.min(axis=1)).max() < 40


def test_surfaces_of_uavs_have_plain_colours():
    for material in MATERIAL_OF.values():
        first, second = PROPERTIES[material]["colours"]
        assert first == second
