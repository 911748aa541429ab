"""Views and layers: what keys, menu and mouse do to the scene view."""

import numpy as np
import pytest
from page_browsing import save_screenshot
from page_serving import Served
from scene_reading import eye, pixels, wait_for_frames, wait_for_world, wait_until
from truth import hurried, position_of, vehicle
from working import SMALL, press_canvas, pull

pytestmark = pytest.mark.slow

SCANNED = """
name = "scanned"
description = "An F450 with a level and a nodding scanner between blocks."
duration_s = 36000.0
[world.terrain]
kind = "flat"
extent_m = 60.0
[world.grid_map]
maps = [{ file = "blocks.csv", name = "blocks" }]
cell_size_m = 2.0
block_height_m = 4.0
origin_m = [-7.0, -7.0]
[types.scanner]
airframe = "f450"
[[types.scanner.sensors]]
kind = "lidar"
name = "horizontal"
position_m = [0.0, 0.0, 0.18]
[[types.scanner.sensors]]
kind = "lidar"
name = "nodding"
position_m = [0.10, 0.0, -0.08]
nodding = { amplitude_deg = 45.0, period_s = 1.0 }
[[types.scanner.sensors]]
kind = "imu"
[[types.scanner.sensors]]
kind = "odometry"
[[types.scanner.sensors]]
kind = "ground_truth"
[[uavs]]
type = "scanner"
position_m = [0.0, 0.0]
on_start = "take_off"
"""
BLOCKS = "\n".join(["1,0,0,1,0,0,1", *["0,0,0,0,0,0,0"] * 5, "1,0,0,0,0,0,1"])


@pytest.fixture(scope="module")
def served(chromium, tmp_path_factory):
    folder = tmp_path_factory.mktemp("scanned")
    (folder / "blocks.csv").write_text(BLOCKS)
    (folder / "scanned.toml").write_text(SCANNED)
    with Served(str(folder / "scanned.toml")) as server:
        with hurried(server):
            vehicle(server, "uav1", lambda state: state["mode"] == "HOLD")
        yield server


@pytest.fixture(scope="module")
def opened(module_browsing, served):
    page = module_browsing.open(served.url + "#quality=minimal&uav=uav1", viewport=SMALL)
    wait_for_world(page)
    page.keyboard.press("m")
    return page


@pytest.fixture
def page(opened, shared):
    press_canvas(opened)
    opened.keyboard.press("1")
    return opened


def uav_distance(page, served):
    return float(np.linalg.norm(eye(page) - position_of(served, "uav1")))


def test_a_walker_is_stopped_by_a_block(browsing, served):
    look = "#view=walk&camera=0_2_0_1.5708_0_0"
    page = browsing.open(served.url + look, viewport=SMALL)  # south of the block at x -1..1, y 5..7
    wait_for_world(page)
    wait_until(page, lambda page: abs(eye(page)[1] - 2.0) < 0.1)
    press_canvas(page)
    page.keyboard.down("KeyW")
    wait_until(page, lambda page: eye(page)[1] > 4.0)
    wait_for_frames(page, 15)
    page.keyboard.up("KeyW")
    assert 4.0 < eye(page)[1] < 5.0


def test_a_link_keeps_scenario_view_camera_and_selection(browsing, served):
    first = browsing.open(served.url + "#view=fly&camera=-9_4_6_-0.5_-0.3_0")
    wait_for_world(first)
    link, stood = first.url, eye(first)
    first.close()  # software draws one page at a time in good time
    second = browsing.open(link.replace("view=fly", "view=fly&uav=uav1"))
    wait_for_world(second)
    second.get_by_role("button", name="Fly through", pressed=True).wait_for()
    assert "uav=uav1" in second.url
    np.testing.assert_allclose(eye(second), stood, atol=0.02)
    second.close()
    # A link to another scenario offers that one, and leaves alone what flies.
    assert "scenario=scanned" in link
    third = browsing.open(link.replace("scenario=scanned", "scenario=hover"), viewport=SMALL)
    third.get_by_role("dialog", name="hover").get_by_role("button", name="Start").wait_for()
    assert served.status()["scenario"] == "scanned"


def test_every_number_key_has_its_view(page, served):
    page.keyboard.press("4")
    wait_until(page, lambda page: 0.5 < uav_distance(page, served) < 12.0 and behind(page, served))
    page.keyboard.press("5")
    wait_until(page, lambda page: uav_distance(page, served) < 0.6)
    save_screenshot(page, "onboard")
    page.keyboard.press("2")
    wait_until(page, lambda page: abs(eye(page)[2] - 1.7) < 0.05)
    page.keyboard.press("3")
    page.get_by_role("button", name="Fly through", pressed=True).wait_for()
    press_canvas(page)
    start = eye(page)
    page.keyboard.down("KeyW")
    wait_until(page, lambda page: np.linalg.norm(eye(page) - start) > 0.5)
    page.keyboard.up("KeyW")
    page.keyboard.press("1")
    page.get_by_role("button", name="Orbit", pressed=True).wait_for()
    assert "view=orbit" in page.url


def heading(page):
    x, y, z, w = page.evaluate("window.volery.camera.quaternion")
    return np.array([-2 * (x * z + w * y), -2 * (y * z - w * x), 2 * (x * x + y * y) - 1])


def behind(page, served):
    """Whether the eye is west of a UAV that looks east, and looks at it."""
    return eye(page)[0] < position_of(served, "uav1")[0] - 0.5 and heading(page)[0] > 0.5


def test_a_change_of_view_is_no_leap(page):
    page.keyboard.press("1")
    wait_for_frames(page, 5)
    page.evaluate(
        """() => {
          window.eyes = [];
          const look = () => {
            window.eyes.push([...window.volery.camera.position]);
            requestAnimationFrame(look);
          };
          look();
        }"""
    )
    page.keyboard.press("2")
    wait_until(page, lambda page: abs(eye(page)[2] - 1.7) < 0.05)
    heights = np.array(page.evaluate("window.eyes"))[:, 2]
    between = (heights > heights[-1] + 0.1) & (heights < heights[0] - 0.1)
    assert between.any()  # it passed positions in between


def test_orbit_turns_and_comes_nearer(page, served):
    page.keyboard.press("1")
    wait_for_frames(page, 10)
    before, far = eye(page), uav_distance(page, served)
    box = page.get_by_label("Scene", exact=True).bounding_box()
    middle = (box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    pull(page, middle, (middle[0] + 90, middle[1]))
    wait_until(page, lambda page: np.linalg.norm(eye(page) - before) > 1.0)
    page.mouse.move(*middle)
    page.mouse.wheel(0, -400)
    wait_until(page, lambda page: uav_distance(page, served) < 0.9 * far)


def fraction_of(page, red):
    """Fraction of the image that is as red, or as blue, as returns are."""
    image = pixels(page)
    r, g, b = np.moveaxis(image, 2, 0)
    mask = (r > 0.6) & (g < 0.45) & (b < 0.45) if red else (b > 0.6) & (r < 0.35) & (g < 0.62)
    return float(mask.mean())


def test_returns_of_scanners_are_blue_and_red(page, served):
    page.goto(served.url + "#view=fly&quality=minimal&uav=uav1&camera=-6_0_9_0_-0.85_0")
    wait_until(page, lambda page: abs(eye(page)[2] - 9.0) < 0.2)
    show_returns(page, False)
    bare = {
        red: fraction_of(page, red) for red in (True, False)
    }  # the airframe has both of its own
    show_returns(page, True)
    for red, fraction in bare.items():
        wait_until(
            page, lambda page, red=red, fraction=fraction: fraction_of(page, red) > fraction + 2e-4
        )
    save_screenshot(page, "returns")


def show_returns(page, shown):
    page.get_by_role("button", name="Layers").click()
    page.get_by_role("checkbox", name="LIDAR returns").set_checked(shown)
    page.keyboard.press("Escape")
    page.get_by_role("checkbox", name="LIDAR returns").wait_for(state="hidden")
    wait_for_frames(page, 3)
