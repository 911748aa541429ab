"""What programs publish beside the sensors is in the scene view: maps, voxels, markers, paths."""

import threading
from contextlib import ExitStack

import numpy as np
import pytest
import roslibpy
from page_browsing import save_screenshot
from scene_reading import eye, pixels, project, wait_for_frames, wait_for_world, wait_until
from working import SMALL

pytestmark = pytest.mark.slow

LOOK = "#view=fly&quality=minimal&camera=-8_0_9_0_-0.8_0"
"""From the west down to the origin, where the UAV is not."""
PERIOD_S = 0.5
MAP = {"frame_id": "map"}
LEVELS = 16


@pytest.fixture(scope="module")
def opened(module_browsing, served):
    page = module_browsing.open(served.url + LOOK, viewport=SMALL)
    wait_for_world(page)
    page.keyboard.press("m")
    wait_until(page, lambda page: abs(eye(page)[2] - 9.0) < 0.1)
    return page


@pytest.fixture
def page(opened, shared):
    return opened


class Publishing:
    """A program beside the page that publishes one message again and again."""

    def __init__(self, served, topic, msgtype, message):
        self._topic = roslibpy.Topic(served.ros, topic, msgtype, latch=True)
        self._message = roslibpy.Message(message)
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._publish)

    def _publish(self):
        while not self._ended.is_set():
            self._topic.publish(self._message)
            self._ended.wait(PERIOD_S)

    def __enter__(self):
        self._thread.start()

    def __exit__(self, *_):
        self._ended.set()
        self._thread.join()
        self._topic.unadvertise()


def colours_at(page, positions):
    """What is seen at positions of the map: a colour (3,) each, 0 to 1."""
    box = page.get_by_label("Scene", exact=True).bounding_box()
    image, seen = pixels(page), {}
    for name, position in positions.items():
        x, y = project(page, position)
        column, row = round(x - box["x"]), round(y - box["y"])
        seen[name] = image[row - 2 : row + 3, column - 2 : column + 3].mean(axis=(0, 1))
    return seen


def marker():
    """A magenta cube of 1 m."""
    return {
        "header": MAP,
        "ns": "test",
        "type": 1,
        "pose": {"position": {"x": 1.0, "y": 3.0, "z": 0.5}, "orientation": {"w": 1.0}},
        "scale": {"x": 1.0, "y": 1.0, "z": 1.0},
        "color": {"r": 1.0, "g": 0.0, "b": 1.0, "a": 1.0},
    }


def occupancy():
    """4 m by 4 m, all of it occupied."""
    origin = {"position": {"x": -1.0, "y": -5.0, "z": 0.0}, "orientation": {"w": 1.0}}
    info = {"resolution": 1.0, "width": 4, "height": 4, "origin": origin}
    return {"header": MAP, "info": info, "data": [100] * 16}


def octomap(point, resolution):
    """One occupied cube of the second finest level around a point, as a binary stream."""
    middle, side, data = np.zeros(3), resolution * 2**LEVELS, []
    for level in range(LEVELS - 1):
        side /= 2
        above = np.asarray(point) >= middle
        middle += np.where(above, side / 2, -side / 2)
        child = int(above @ (1, 2, 4))
        bits = (2 if level == LEVELS - 2 else 3) << (2 * child)
        data += [bits & 0xFF, bits >> 8]
    data = [byte - 256 if byte > 127 else byte for byte in data]
    message = {
        "header": MAP,
        "binary": True,
        "id": "OcTree",
        "resolution": resolution,
        "data": data,
    }
    return message, middle


def path():
    """A line to the north."""
    poses = [
        {"header": MAP, "pose": {"position": {"x": -3.0, "y": y, "z": 0.5}}}
        for y in np.linspace(-4.0, 4.0, 9)
    ]
    return {"header": MAP, "poses": poses}


def test_markers_maps_and_voxels_stand_where_they_are(page, served):
    voxels, middle = octomap((3.0, -1.6, 0.6), 0.6)
    layers = {
        "/marker": ("visualization_msgs/msg/Marker", marker(), (1.0, 3.0, 1.0)),
        "/map": ("nav_msgs/msg/OccupancyGrid", occupancy(), (1.0, -3.0, 0.05)),
        "/octomap": ("octomap_msgs/msg/Octomap", voxels, middle),
        "/plan": ("nav_msgs/msg/Path", path(), (-3.0, 1.5, 0.5)),
    }
    positions = {topic: position for topic, (_, _, position) in layers.items()}
    before = colours_at(page, positions)

    def changed(page):
        return [
            t for t, c in colours_at(page, positions).items() if np.abs(c - before[t]).max() > 0.1
        ]

    with ExitStack() as published:
        for number, (topic, (msgtype, message, _)) in enumerate(layers.items()):
            published.enter_context(Publishing(served, topic, msgtype, message))
            expected = list(layers)[: number + 1]  # and nothing where the others will be
            wait_until(page, lambda page, expected=expected: changed(page) == expected)
        wait_for_frames(page, 2)
        seen = colours_at(page, positions)
        save_screenshot(page, "layers")
    red, green, blue = seen["/marker"]
    assert min(red, blue) > green + 0.2
    assert np.ptp(seen["/map"]) < 0.15  # occupied is black or grey, on green
    assert seen["/map"].mean() < before["/map"].mean()
