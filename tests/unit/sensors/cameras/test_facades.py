"""Windows on walls: rows of storeys, bays along the wall, colours of solids."""

import numpy as np
import pytest

from volery.core import rotations
from volery.sensors.cameras.camera import take
from volery.sensors.cameras.light import make_light
from volery.sensors.cameras.model import CameraModel
from volery.sensors.lidar.lidar import make_batch, stack_mounts
from volery.sensors.mount import make_mount
from volery.vehicle.pose_history import new_history
from volery.world.materials import Material
from volery.world.mesh import Mesh
from volery.world.scene import Look, Scene, Solid
from volery.world.terrain import Terrain

CAMERA = CameraModel(width=160, height=120, horizontal_fov_deg=60.0)
PIXEL_M = 2.0 * 20.0 * np.tan(np.radians(30.0)) / 160  # on a wall 20 m away


def wall(material, look):
    """An upright rectangle 20 m north of the camera, 30 m wide, from z = 0 to 20."""
    corners = np.array([[-15, 20, 0], [15, 20, 0], [15, 20, 20], [-15, 20, 20]], np.float32)
    return Solid(Mesh(corners, np.array([[0, 1, 2], [0, 2, 3]])), material, "wall", look=look)


@pytest.fixture
def render():
    scenes = []

    def shoot(solid):
        scene = Scene(Terrain.flat(200.0, origin=(-100.0, -100.0)), None, solids=[solid])
        scenes.append(scene)
        history = new_history([[0.0, 0.0, 8.0]], [rotations.from_rpy(0, 0, np.pi / 2)], 1_000_000)
        batch = make_batch([0], [0], [0], [0], [0], stack_mounts([make_mount()]))
        light = make_light(sun_elevation_deg=30.0, sun_azimuth_deg=180.0)  # on the wall
        seen = take(scene, CAMERA, light, batch, history)
        return seen.colour[0].astype(float), seen.material[0]

    yield shoot
    for scene in scenes:
        scene.close()


def test_storeys_and_bays_show_as_dark_panes(render):
    """Three storeys of 4 m: three rows of panes, a plain wall above; bays 2.6 m apart."""
    colour, material = render(wall(Material.FACADE, Look(storey_m=4.0, storeys=3)))
    assert (material[20:100] == Material.FACADE).all()
    green = colour[..., 1]
    height_m = 8.0 - (np.arange(120) - 59.5) * PIXEL_M
    dark = (green < 0.6 * np.median(green[(height_m > 12.2) & (height_m < 15.0)])).mean(axis=1)
    rows = dark > 0.2
    starts = np.flatnonzero(rows[1:] & ~rows[:-1])
    assert sum(0.6 < height_m[k] < 12.0 for k in starts) == 3
    assert not rows[(height_m > 12.2) & (height_m < 15.0)].any()  # above the last storey
    line = green[np.argmin(abs(height_m - 6.2))]  # the middle of the second storey
    spectrum = abs(np.fft.rfft(line - line.mean()))
    bays = np.fft.rfftfreq(160, PIXEL_M)[np.argmax(spectrum)]
    assert 1.0 / bays == pytest.approx(2.6, rel=0.1)


def test_without_storeys_a_facade_has_no_panes(render):
    colour, _ = render(wall(Material.FACADE, Look()))
    band = colour[40:80, :, 1]
    assert band.min() > 0.8 * band.max()


def test_painted_solids_have_their_own_colour(render):
    red, material = render(wall(Material.PAINTED, Look(colour=(0.8, 0.05, 0.05))))
    assert (material[20:100] == Material.PAINTED).all()
    assert (red[60, :, 0] > 2.0 * red[60, :, 1]).all()
