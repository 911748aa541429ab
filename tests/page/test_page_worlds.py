"""Worlds are chosen and changed on the page, and stand in the simulation and in the scene view."""

import json
import re
import urllib.error

import pytest
from page_browsing import save_screenshot
from page_serving import Served
from scene_reading import pixels, wait_for_frames, wait_for_world, wait_until
from truth import until, vehicle
from working import SMALL, choose, open_panel, set_slider

pytestmark = pytest.mark.slow

GROVE = """
name = "grove"
description = "An F450 beside a few trees and blocks."
duration_s = 36000.0
[world.terrain]
kind = "flat"
extent_m = 60.0
[world.forest]
kind = "procedural"
region_m = [0.0, -20.0, 40.0, 20.0]
trees = 4
[world.forest.species]
broadleaf = 1.0
[types.f450]
airframe = "f450"
[[types.f450.sensors]]
kind = "imu"
[[types.f450.sensors]]
kind = "odometry"
[[types.f450.sensors]]
kind = "ground_truth"
[[uavs]]
type = "f450"
position_m = [-5.0, 0.0]
"""
BLOCKS = GROVE.replace("grove", "blocks").replace(
    GROVE[GROVE.index("[world.forest]") : GROVE.index("[types.f450]")],
    '[world.grid_map]\nmaps = [{ file = "blocks.csv", name = "one" }]\n'
    "cell_size_m = 2.0\nblock_height_m = 3.0\norigin_m = [0.0, -5.0]\n",
)
LOOK = "#view=fly&camera=-20_0_2_0_0_0&quality=minimal"


@pytest.fixture(scope="module")
def served(chromium, tmp_path_factory):
    folder = tmp_path_factory.mktemp("recordings")
    for name, text in (("grove", GROVE), ("blocks", BLOCKS)):
        (folder / "uploads" / name).mkdir(parents=True)
        (folder / "uploads" / name / "scenario.toml").write_text(text)
    (folder / "uploads" / "blocks" / "blocks.csv").write_text("0,0,0\n0,1,0\n0,0,0\n")
    with Served("hover", "--recordings-dir", str(folder)) as server:
        yield server


@pytest.fixture(scope="module")
def opened(module_browsing, served):
    page = module_browsing.open(served.url + LOOK, viewport=SMALL)
    wait_for_world(page)
    page.keyboard.press("m")
    return page


@pytest.fixture
def page(opened, shared, served):
    shared.expected += ["WebSocket connection", "Failed to load", "503"]  # while worlds change
    opened.goto(served.url + LOOK)
    return opened


def start(page, served, name, work=lambda dialog: None):
    """Choose the card, set up how it is flown, start it and wait until it flies."""
    before = served.status()["world"]
    page.get_by_role("button", name=re.compile("choose another scenario")).click()
    page.get_by_label("Search", exact=True).fill(name)
    card = page.get_by_role("button", name=re.compile(f"^{name}: "))
    card.wait_for()
    card.click()
    dialog = page.get_by_role("dialog", name=name)
    work(dialog)
    dialog.get_by_role("button", name="Start", exact=True).click()
    dialog.wait_for(state="detached", timeout=120_000)
    until(
        lambda: (
            (status := served.status())["state"] == "flying"
            and status["scenario"] == name
            and status["world"] != before
        ),
        120,
    )


def world(served):
    data = served.fetch("world.glb")
    return json.loads(data[20 : 20 + int.from_bytes(data[12:16], "little")])


def standing(page):
    """Fraction of the image above the horizon that is not sky: sky is blue or grey.

    Waits until nothing lies over the scene, such as that a world is being built.
    """
    page.locator(".situation").wait_for(state="hidden", timeout=120_000)
    page.get_by_role("dialog").wait_for(state="hidden", timeout=120_000)
    image = pixels(page)
    height, width, _ = image.shape
    part = image[int(0.12 * height) : int(0.47 * height), int(0.15 * width) : int(0.95 * width)]
    return float((part[..., 2] < part[..., 0] + 0.02).mean())


def test_a_card_is_chosen_with_uavs_airframe_and_sensors(page, served):
    def set_up(dialog):
        save_screenshot(page, "set_up")
        dialog.get_by_role("textbox", name="UAVs", exact=True).fill("3")
        choose(page, dialog.get_by_role("combobox", name="Airframe"), "crazyflie")
        dialog.get_by_role("checkbox", name="camera").check()
        dialog.get_by_role("checkbox", name="lidar").check()
        dialog.get_by_role("checkbox", name="sonar").uncheck()

    page.get_by_role("button", name=re.compile("choose another scenario")).click()
    card = page.get_by_role("button", name=re.compile("^hover: "))
    for text in ("1 UAV: f450", "sonar, IMU", "open ground"):
        card.get_by_text(text).wait_for()
    image = card.locator("img")
    until(lambda: image.evaluate("image => image.naturalWidth") > 100)  # a real image
    save_screenshot(page, "cards")
    page.keyboard.press("Escape")
    page.get_by_role("dialog").wait_for(state="detached")
    page.evaluate("window.samePage = true")
    restart(page, served, set_up)
    page.get_by_label("Number of UAVs").get_by_text("3 UAVs").wait_for()
    last = vehicle(served, "uav3")
    assert last["airframe"] == "crazyflie"
    response = served.call("/rosapi/topics", "rosapi_msgs/srv/Topics")
    own = {
        n: t for n, t in zip(response["topics"], response["types"], strict=True) if "/uav3/" in n
    }
    assert "sensor_msgs/msg/Image" in own.values()
    assert {"sensor_msgs/msg/LaserScan", "sensor_msgs/msg/PointCloud2"} & set(own.values())
    assert "sensor_msgs/msg/Range" not in own.values()
    wait_until(page, lambda page: page.evaluate("window.volery.uavs().length") == 3)
    assert page.evaluate("window.samePage") is True


def restart(page, served, work):
    """The same world once more: its id may stay."""
    vehicle(served, "uav1")
    page.get_by_role("button", name=re.compile("choose another scenario")).click()
    page.get_by_role("button", name=re.compile("^hover: ")).click()
    dialog = page.get_by_role("dialog", name="hover")
    work(dialog)
    dialog.get_by_role("button", name="Start", exact=True).click()
    dialog.wait_for(state="detached", timeout=120_000)
    until(lambda: served.status()["state"] == "flying")


def test_more_trees_a_hectare_are_built_and_seen(page, served):
    wait_until(page, lambda page: standing(page) < 0.005)  # the open ground is drawn
    start(page, served, "grove")
    assert world(served)["asset"]["extras"]["trees"] == 4
    wait_until(page, lambda page: standing(page) > 0.01)
    wait_for_frames(page, 5)
    few = standing(page)
    panel = open_panel(page, "Environment")
    panel.get_by_label("Trees per hectare").fill("500")
    panel.get_by_role("button", name="Rebuild").click()
    until(lambda: served.status()["state"] == "flying" and trees(served) > 60, 120)
    assert trees(served) == pytest.approx(80, abs=1)  # 0.16 ha
    wait_until(page, lambda page: standing(page) > 1.3 * few)
    save_screenshot(page, "denser")


def trees(served):
    try:
        return world(served)["asset"]["extras"]["trees"]
    except urllib.error.HTTPError as error:
        if error.code != 404:
            raise
        return 0  # while the world is built


def test_blocks_grow_by_their_sliders(page, served):
    before = standing(page)
    start(page, served, "blocks")
    panel = open_panel(page, "Environment")
    panel.get_by_role("slider", name="Height", exact=True).wait_for()
    wait_until(page, lambda page: abs(standing(page) - before) > 0.005)  # the other world is gone
    wait_for_frames(page, 5)
    low = wait_until(page, standing)
    set_slider(page, "Height", "ArrowRight", 10)
    until(lambda: blocks(served)["block_height"] == pytest.approx(8.0))
    wait_until(page, lambda page: standing(page) > 2.0 * low)
    wait_for_frames(page, 3)
    high = standing(page)
    set_slider(page, "Cell size", "ArrowRight", 8)
    until(lambda: blocks(served)["cell_size"] == pytest.approx(4.0))
    wait_until(page, lambda page: standing(page) > 1.3 * high)
    save_screenshot(page, "blocks")


def blocks(served):
    return served.call("/volery/get_grid_map", "volery_interfaces/srv/GetGridMap")
