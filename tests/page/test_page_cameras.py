"""Tiles of what cameras see: the pixels of the tiles are those of the messages; hands move them."""

import base64
import io

import numpy as np
import pytest
from page_browsing import save_screenshot
from page_serving import Served
from PIL import Image
from scene_reading import wait_for_world, wait_until
from truth import until
from working import WIDE, pull

pytestmark = pytest.mark.slow

WIDTH, HEIGHT = 80, 60
BLOCKS = "0,0,0,0\n0,0,0,1\n0,0,0,0\n1,0,0,0\n"
SCENARIO_TOML = f"""
name = "seen"
description = "An F450 stands and looks at blocks."
duration_s = 36000.0
[world.terrain]
kind = "flat"
extent_m = 60.0
[world.grid_map]
maps = [{{ file = "blocks.csv", name = "blocks" }}]
cell_size_m = 3.0
block_height_m = 3.0
origin_m = [4.0, -6.0]
[types.seer]
airframe = "f450"
[[types.seer.sensors]]
kind = "camera"
name = "front"
rate_hz = 5.0
width = {WIDTH}
height = {HEIGHT}
position_m = [0.12, 0.0, 0.4]
[[types.seer.sensors]]
kind = "imu"
[[types.seer.sensors]]
kind = "odometry"
[[types.seer.sensors]]
kind = "ground_truth"
[[uavs]]
type = "seer"
position_m = [0.0, 0.0]
on_start = "wait"
"""


@pytest.fixture(scope="module")
def served(chromium, tmp_path_factory):
    folder = tmp_path_factory.mktemp("seen")
    (folder / "blocks.csv").write_text(BLOCKS)
    (folder / "seen.toml").write_text(SCENARIO_TOML)
    with Served(str(folder / "seen.toml")) as server:
        yield server


@pytest.fixture(scope="module")
def opened(module_browsing, served):
    page = module_browsing.open(served.url, viewport=WIDE)
    page.get_by_role("option", name="uav1").wait_for()
    wait_for_world(page)
    page.keyboard.press("p")
    page.keyboard.press("m")
    return page


@pytest.fixture
def page(opened, shared):
    return opened


def tile(page, title):
    return page.get_by_role("group", name=title, exact=True)


def titles(page):
    """Colour and depth, as their tiles are called."""
    groups = page.locator(".tile canvas.camera-image")
    until(lambda: groups.count() == 2, what="there are no two tiles")
    names = [groups.nth(k).get_attribute("aria-label") for k in range(2)]
    return sorted(names, key=lambda name: "depth" in name)


def shown(page, title):
    """(height, width, 3) pixels of a tile's canvas, once an image has come."""
    canvas = page.get_by_role("img", name=title, exact=True)
    wait_until(page, lambda _: canvas.evaluate("canvas => canvas.width") == WIDTH)
    data = canvas.evaluate("canvas => canvas.toDataURL('image/png')").partition(",")[2]
    image = Image.open(io.BytesIO(base64.b64decode(data))).convert("RGB")
    return np.asarray(image, dtype=float)


def sent(served, *, depth):
    """The raw image of the camera as a client beside the page receives it."""
    topics = served.call("/rosapi/topics", "rosapi_msgs/srv/Topics")["topics"]
    ending = "front/depth" if depth else "front/image_raw"
    (name,) = [name for name in topics if name.endswith(ending)]
    message = served.once(name, "sensor_msgs/msg/Image")
    assert (message["width"], message["height"]) == (WIDTH, HEIGHT)
    data = message["data"]
    return base64.b64decode(data) if isinstance(data, str) else bytes(data)


def test_colours_are_those_of_the_camera(page, served):
    colour, _ = titles(page)
    seen = shown(page, colour)
    true = np.frombuffer(sent(served, depth=False), np.uint8).reshape(HEIGHT, WIDTH, 3)
    assert true.std() > 20.0  # there is something to be seen
    assert np.abs(seen - true).mean() < 4.0  # JPEG of the same
    save_screenshot(page, "pictures")


def test_depth_is_near_red_and_far_blue(page, served):
    _, depth = titles(page)
    seen = shown(page, depth)
    true = np.frombuffer(sent(served, depth=True), np.float32).reshape(HEIGHT, WIDTH)
    known = np.isfinite(true)
    assert 0.2 < known.mean() < 0.9  # the sky has no depth
    min_m, max_m = true[known].min(), true[known].max()
    span = max_m - min_m
    near, far = known & (true < min_m + 0.1 * span), known & (true > max_m - 0.2 * span)
    assert (seen[near][:, 0] > seen[near][:, 2] + 50).mean() > 0.95
    assert (seen[far][:, 2] > seen[far][:, 0]).mean() > 0.95
    assert np.ptp(seen[~known], axis=0).max() < 8.0  # what is not known has one colour
    legend = page.locator(".camera-legend").get_attribute("aria-label")
    limits = [float(part.split()[0]) for part in legend.split(" to ")]
    assert limits[0] == pytest.approx(min_m, abs=0.3)
    assert limits[1] == pytest.approx(
        max_m, rel=0.1
    )  # of another image, and noise grows with range


def test_a_tile_shows_the_rate_at_which_images_come(page):
    colour, _ = titles(page)
    label = page.get_by_label(f"{colour}: rate and age")
    until(lambda: label.inner_text()[:1] in set("0123456789"))
    until(lambda: float(label.inner_text().split()[0]) == pytest.approx(5.0, rel=0.25))


def test_tiles_are_dragged_resized_and_closed(page):
    colour, depth = titles(page)
    before = tile(page, colour).bounding_box()
    start = (before["x"] + 40, before["y"] + 8)
    pull(page, start, (start[0] + 90, start[1] - 120))
    after = tile(page, colour).bounding_box()
    assert after["x"] - before["x"] == pytest.approx(90, abs=3)
    assert after["y"] - before["y"] == pytest.approx(-120, abs=3)
    corner = tile(page, colour).locator(".tile-corner")
    away = -1 if corner.get_attribute("data-side") == "left" else 1
    box = corner.bounding_box()
    grip = (box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    pull(page, grip, (grip[0] + 80 * away, grip[1]))
    larger = tile(page, colour).bounding_box()
    assert larger["width"] - after["width"] == pytest.approx(80, abs=3)
    assert larger["height"] - after["height"] == pytest.approx(60, abs=8)  # 4 to 3
    page.get_by_role("button", name=f"{colour}: smaller").click()
    assert tile(page, colour).bounding_box()["width"] == pytest.approx(larger["width"] - 40, abs=3)
    page.reload()
    page.locator(".tile canvas.camera-image").first.wait_for()
    kept = tile(page, colour).bounding_box()
    assert kept["width"] == pytest.approx(larger["width"] - 40, abs=3)
    # What lies below comes to the front where it is touched.
    tile(page, depth).get_by_text(depth, exact=True).click(position={"x": 3, "y": 3})
    page.get_by_role("button", name=f"Close {depth}").click()
    tile(page, depth).wait_for(state="detached")
    page.get_by_role("button", name="Select cameras").click()
    page.get_by_role("menuitemcheckbox", name=depth, exact=True).click()
    tile(page, depth).wait_for()


def test_a_tile_moves_by_keys(page):
    colour, _ = titles(page)
    before = tile(page, colour).bounding_box()
    page.get_by_label(f"{colour}: arrow keys move it").focus()
    page.keyboard.press("ArrowUp")
    page.keyboard.press("ArrowRight")
    after = tile(page, colour).bounding_box()
    assert after["x"] > before["x"] + 5
    assert after["y"] < before["y"] - 5
