"""A map of map_server: a .yaml and its image, chosen or dropped together, become a world."""

import json
import re

import pytest
from page_browsing import save_screenshot
from page_serving import Served
from truth import until
from working import WIDE

pytestmark = pytest.mark.slow

ROOM = b"""image: room.pgm
resolution: 0.5
origin: [-1.0, -1.0, 0.0]
negate: 0
occupied_thresh: 0.65
free_thresh: 0.25
"""
IMAGE = b"P5\n3 2\n255\n" + bytes([254, 254, 254, 0, 254, 254])
DROP = """([yaml, image]) => {
    const carried = new DataTransfer();
    carried.items.add(new File([new Uint8Array(image)], "hall.pgm"));
    carried.items.add(new File([new Uint8Array(yaml)], "hall.yaml"));
    window.dispatchEvent(new DragEvent("drop", { dataTransfer: carried, cancelable: true }));
}"""


def file(name, content):
    return {"name": name, "mimeType": "application/octet-stream", "buffer": content}


@pytest.fixture(scope="module")
def served(chromium, tmp_path_factory):
    folder = tmp_path_factory.mktemp("recordings")
    with Served("hover", "--recordings-dir", str(folder)) as server:
        yield server


def test_a_yaml_and_its_image_become_a_world(browsing, served):
    browsing.expected += ["WebSocket connection", "Failed to load", "503"]
    page = browsing.open(served.url, viewport=WIDE)
    page.get_by_role("button", name=re.compile("choose another scenario")).click()
    chooser = page.get_by_role("dialog").locator("input[type=file]").first
    upload = page.get_by_role("button", name="Upload", exact=True)
    chooser.set_input_files([file("room.yaml", ROOM)])
    page.get_by_text("room.yaml is a map together with its image").wait_for()
    assert upload.is_disabled()
    page.locator("input[type=file]").first.set_input_files([file("room.pgm", IMAGE)])
    page.get_by_text("choose or drop it together with its .yaml").wait_for()
    assert upload.is_disabled()
    page.locator("input[type=file]").first.set_input_files(
        [file("room.pgm", IMAGE), file("room.yaml", ROOM)]
    )
    page.get_by_text("room.yaml + room.pgm").wait_for()
    save_screenshot(page, "map_pair")
    upload.click()
    page.get_by_role("button", name="Start", exact=True).click(timeout=120_000)
    until(lambda: (t := served.status())["state"] == "flying" and t["scenario"] == "room", 180)
    data = served.fetch("world.glb")
    extras = json.loads(data[20 : 20 + int.from_bytes(data[12:16], "little")])["asset"]["extras"]
    assert extras["kind"] == "grid_map"


def test_both_files_are_dropped_together(browsing, served):
    page = browsing.open(served.url, viewport=WIDE)
    page.get_by_label("Simulated time").wait_for()
    page.evaluate(DROP, [list(ROOM), list(IMAGE)])
    page.get_by_text("hall.yaml + hall.pgm").wait_for()
    assert page.get_by_role("radio", name="Grid map").is_checked()
    assert page.get_by_role("button", name="Upload", exact=True).is_enabled()
