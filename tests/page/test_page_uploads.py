"""Files of the visitor's own: each kind becomes a world that is flown in and seen."""

import io
import json
import re

import numpy as np
import pytest
import trimesh
from page_browsing import save_screenshot
from page_serving import Served
from PIL import Image
from scene_reading import pixels, wait_for_frames, wait_for_world, wait_until
from truth import put, status, until, vehicle
from working import SMALL

pytestmark = pytest.mark.slow

LOOK = "#view=fly&camera=-28_0_2.5_0_0_0&quality=minimal"
"""From the west, level, at the origin."""


def cells(rows):
    """A field with a block in its middle, so many rows long: each file is another world."""
    field = np.zeros((11, 11), int)
    field[4 : 4 + rows, 4:7] = 1
    return field


LONGITUDE_M, LATITUDE_M = 1 / 55_600.0, 1 / 111_300.0  # degrees, at 60 degrees north


def csv():
    return "\n".join(",".join(map(str, row)) for row in cells(3)).encode()


def png():
    into = io.BytesIO()
    Image.fromarray(((1 - cells(4)) * 255).astype(np.uint8)).save(into, "PNG")
    return into.getvalue()


def moving_ai():
    rows = "\n".join("".join(".@"[cell] for cell in row) for row in cells(5))
    return f"type octile\nheight 11\nwidth 11\nmap\n{rows}\n".encode()


def geojson():
    def corner(x, y):
        return [24.94 + x * LONGITUDE_M, 60.17 + y * LATITUDE_M]

    def house(x, y):
        ring = [corner(x + dx, y + dy) for dx, dy in ((-4, -4), (4, -4), (4, 4), (-4, 4), (-4, -4))]
        geometry = {"type": "Polygon", "coordinates": [ring]}
        return {"type": "Feature", "properties": {"height": "12"}, "geometry": geometry}

    around = [house(x, y) for x in (-40, 0, 40) for y in (-40, 0, 40) if (x, y) != (-40, 0)]
    return json.dumps({"type": "FeatureCollection", "features": around}).encode()


def glb():
    box = trimesh.creation.box((6.0, 8.0, 8.0))  # y of glTF is up
    return trimesh.Scene([box]).export(file_type="glb")


def forest():
    rows = [f"{x},{y},35" for x in (-2, 0, 2) for y in (-2, 0, 2)]
    return "\n".join(["x_m,y_m,dbh_cm", *rows]).encode()


def scenario():
    return b"""
name = "of_mine"
duration_s = 36000.0
[world.forest]
kind = "procedural"
region_m = [-4.0, -4.0, 4.0, 4.0]
trees = 9
minimum_spacing_m = 0.5
[world.forest.species]
broadleaf = 1.0
[types.f450]
airframe = "f450"
[[types.f450.sensors]]
kind = "ground_truth"
[[uavs]]
type = "f450"
count = 2
position_m = [-10.0, -10.0]
last_position_m = [-10.0, 10.0]
"""


KINDS = {
    "field.csv": ("Grid map", csv, "grid_map"),
    "plan.png": ("Grid map", png, "grid_map"),
    "arena.map": ("Grid map", moving_ai, "grid_map"),
    "town.geojson": ("City", geojson, "city"),
    "hall.glb": ("Mesh", glb, "open"),
    "grove.csv": ("Forest", forest, "forest"),
    "flight.toml": ("Scenario", scenario, "forest"),
}
WRONG = {
    "two.csv": ("Grid map", b"0,1\n0,2\n", "line 2, column 2"),
    "broken.png": ("Grid map", b"\x89PNG\r\n\x1a\n broken", "broken.png"),
    "empty.map": ("Grid map", b"type octile\n", "empty.map"),
    "half.geojson": ("City", b"{", "not valid JSON"),
    "nothing.glb": ("Mesh", b"glTF" + b"\0" * 40, "nothing.glb"),
    "columns.csv": ("Forest", b"x,y\n1,2\n", "unknown name"),
    "spy.toml": ("Scenario", scenario() + b'[[nodes]]\nnode = "os:system"\n', "shipped nodes only"),
    "notes.obj": ("Grid map", b"v 0 0 0\n", "not from '.obj'"),
}


@pytest.fixture(scope="module")
def served(chromium, tmp_path_factory):
    folder = tmp_path_factory.mktemp("recordings")
    with Served("hover", "--recordings-dir", str(folder)) as server:
        yield server


@pytest.fixture(scope="module")
def opened(module_browsing, served):
    page = module_browsing.open(served.url + LOOK, viewport=SMALL)
    wait_for_world(page)
    page.keyboard.press("m")  # the map lies over the sky
    return page


@pytest.fixture
def page(opened, shared, served):
    shared.expected += ["WebSocket connection", "Failed to load", "422", "415", "503"]
    opened.goto(served.url + LOOK)  # its part behind the #: where one looks from
    return opened


def bring(page, name, kind, content):
    """Choose the file and what it is, and send it."""
    if page.get_by_role("dialog").count() == 0:
        page.get_by_role("button", name=re.compile("choose another scenario")).click()
    page.get_by_role("dialog").locator("input[type=file]").or_(
        page.locator("input[type=file]")
    ).first.set_input_files(
        {"name": name, "mimeType": "application/octet-stream", "buffer": content}
    )
    page.get_by_role("dialog").get_by_text(name).wait_for()
    page.get_by_role("radio", name=kind).check()
    page.get_by_role("button", name="Upload", exact=True).click()


def stands_ahead(page):
    """How much what is above the horizon ahead differs from the sky beside it."""
    image = pixels(page)
    height, width, _ = image.shape
    band = image[int(0.44 * height) : int(0.48 * height)].mean(axis=0)
    ahead = band[int(0.48 * width) : int(0.52 * width)].mean(axis=0)
    return float(np.abs(ahead - band[int(0.86 * width) : int(0.92 * width)].mean(axis=0)).max())


def world(served):
    """The glTF of what stands in the simulation: its JSON, and poses of what is instanced."""
    data = served.fetch("world.glb")
    length = int.from_bytes(data[12:16], "little")
    return json.loads(data[20 : 20 + length])


def test_at_first_the_horizon_is_clear(page, served):
    put(served, "uav1", 0.0, 60.0, 2.5)  # out of the view
    served.call("/uav1/hold", "std_srvs/srv/Trigger")
    wait_for_frames(page, 3)
    wait_until(page, lambda page: stands_ahead(page) < 0.06)


@pytest.mark.parametrize("name", KINDS)
def test_a_file_becomes_a_world_that_is_flown_in(page, served, name):
    kind, content, expected = KINDS[name]
    before = served.status()["world"]
    page.evaluate("window.samePage = true")
    bring(page, name, kind, content())
    page.get_by_role("button", name="Start", exact=True).click(timeout=120_000)
    stem = name.partition(".")[0]
    until(lambda: flies(served, stem), 180, f"{stem} is not flown")
    assert served.status()["world"] != before
    assert world(served)["asset"]["extras"]["kind"] == expected
    if expected == "forest":
        assert world(served)["asset"]["extras"]["trees"] == 9
    vehicle(served, "uav2")
    page.get_by_role("button", name=re.compile(rf"Scenario {stem}.*: choose")).wait_for()
    wait_until(page, lambda page: stands_ahead(page) > 0.1)
    assert page.evaluate("window.samePage") is True
    save_screenshot(page, f"uploaded_{stem}_{expected}")


def flies(served, stem):
    status = served.status()
    return status["state"] == "flying" and status["scenario"].startswith(stem)


def test_wrong_files_are_refused_with_the_reason_and_nothing_is_lost(page, served):
    known = json.loads(served.fetch("scenarios"))
    flown = served.status()
    before = status(served)["stamp"]["sec"]
    for name, (kind, content, why) in WRONG.items():
        bring(page, name, kind, content)
        refused = page.get_by_role("alert").filter(has_text="Cannot make a scenario")
        refused.filter(has_text=re.compile(re.escape(why))).wait_for()
    save_screenshot(page, "wrong_upload")
    assert json.loads(served.fetch("scenarios")) == known
    assert served.status() == flown
    status(served, lambda message: message["stamp"]["sec"] > before)  # it has flown on
    page.keyboard.press("Escape")
    page.get_by_role("dialog").wait_for(state="detached")
