"""Many UAVs on the page: selected together and commanded, coloured, their distances plotted."""

import json
import re

import numpy as np
import pytest
import roslibpy
from page_browsing import save_screenshot
from scene_reading import wait_for_frames, wait_for_rest, wait_for_world
from truth import hurried, until
from working import SMALL, WIDE, open_panel, panel_button, pull

from volery_benchmarks.page.worlds import crowd

pytestmark = pytest.mark.slow

UAVS = 36
SPACING_M = 4.0
VEHICLES = "volery_interfaces/msg/VehicleStates"


@pytest.fixture(scope="module")
def served(chromium, tmp_path_factory):
    from page_serving import Served

    path = tmp_path_factory.mktemp("crowd") / "crowd.toml"
    path.write_text(crowd(UAVS))
    with Served(str(path)) as server:
        all_vehicles(server, lambda uavs: {uav["mode"] for uav in uavs} == {"HOLD"})
        yield server


@pytest.fixture(scope="module")
def opened(module_browsing, served):
    page = module_browsing.open(served.url + "#uav=uav1", viewport=WIDE)
    wait_for_world(page)
    wait_for_rest(page)
    return page


@pytest.fixture
def page(opened, shared):
    return opened


def all_vehicles(served, fits=lambda _: True):
    """States of all UAVs, once they are so."""
    return served.once("/volery/vehicles", VEHICLES, lambda m: fits(m["vehicles"]))["vehicles"]


def with_ctrl(page, act):
    page.keyboard.down("Control")
    act()
    page.keyboard.up("Control")


def canvas_box(page):
    return page.get_by_label("Scene", exact=True).locator("canvas").first.bounding_box()


def selected_text(page):
    found = re.search(r", (\d+) selected", page.get_by_label("Number of UAVs").inner_text())
    return 0 if found is None else int(found[1])


def test_a_box_selects_uavs_and_commands_are_for_all_of_them(page, served):
    box = canvas_box(page)
    seen = [uav for uav in page.evaluate("window.volery.uavs()") if uav["visible"]]
    assert len(seen) > UAVS / 2
    right, low = box["x"] + box["width"] - 2, box["y"] + box["height"] - 2
    with_ctrl(page, lambda: pull(page, (right, low), (box["x"] + 2, box["y"] + 60)))
    until(lambda: selected_text(page) > UAVS / 2)
    save_screenshot(page, "group_selected")
    page.get_by_role("button", name="Select all").click()
    until(lambda: selected_text(page) == UAVS)
    with_ctrl(page, page.get_by_role("option", name=re.compile(r"^uav2\b")).click)
    until(lambda: selected_text(page) == UAVS - 1)
    inspector = open_panel(page, "Inspector")
    inspector.get_by_role("heading", name=f"{UAVS - 1} UAVs selected").wait_for()
    inspector.get_by_role("button", name="Land").click()
    save_screenshot(page, "group_inspector")
    with hurried(served):
        states = all_vehicles(
            served, lambda uavs: sum(uav["mode"] == "LANDED" for uav in uavs) == UAVS - 1
        )
    assert [uav["name"] for uav in states if uav["mode"] != "LANDED"] == ["uav2"]
    page.keyboard.press("t")  # the keys are for all of them, too
    with hurried(served):
        all_vehicles(served, lambda uavs: all(uav["mode"] == "HOLD" for uav in uavs))
    page.keyboard.press("Escape")
    until(lambda: selected_text(page) == 0)


def test_a_group_goes_to_a_position_in_formation(page, served):
    page.get_by_label("Search UAVs").fill("uav3")
    page.get_by_role("button", name=re.compile("^Select 8$")).click()  # 3, 30 to 36
    page.get_by_label("Search UAVs").fill("")
    until(lambda: selected_text(page) == 8)
    page.get_by_role("option", name=re.compile(r"^uav1\b")).click()
    for name in ("uav2", "uav3"):  # with the first, the row with nothing before it
        with_ctrl(page, page.get_by_role("option", name=re.compile(rf"^{name}\b")).click)
    group = {"uav1", "uav2", "uav3"}
    until(lambda: selected_text(page) == len(group))
    before = positions_of(all_vehicles(served), group)
    page.keyboard.press("g")
    page.get_by_text("Goal of 3 UAVs: click the ground or the map").wait_for()
    box = canvas_box(page)
    page.mouse.click(box["x"] + 0.5 * box["width"], box["y"] + 0.8 * box["height"])
    with hurried(served):
        all_vehicles(served, lambda uavs: moved(uavs, group, before) > 0.5)
        after = all_vehicles(
            served,
            lambda uavs: all(
                np.linalg.norm(list(uav["velocity"].values())) < 0.05
                and uav["mode"] in ("HOLD", "GO_TO")
                for uav in uavs
            ),
        )
    now = positions_of(after, group)
    np.testing.assert_allclose(now - now.mean(0), before - before.mean(0), atol=0.5)


def positions_of(uavs, group):
    """(N, 2) m, map."""
    return np.array([[u["position"]["x"], u["position"]["y"]] for u in uavs if u["name"] in group])


def moved(uavs, group, before):
    return np.abs(positions_of(uavs, group) - before).max()


def test_colours_stand_for_what_is_chosen(page):
    page.get_by_role("button", name="Layers", exact=True).click()
    colours = page.get_by_label("Colour of UAVs", exact=True)
    legend = page.get_by_role("note", name="Colours of UAVs")
    assert legend.count() == 0
    for choice, text in [
        ("height", r"UAVs, height 0 m\s*\d+ m"),
        ("battery", r"UAVs, battery 0 %\s*100 %"),
        ("speed", r"UAVs, speed 0 m/s\s*\d+ m/s"),
        ("type", "f450"),
    ]:
        colours.get_by_text(choice, exact=True).click()
        until(lambda text=text: legend.count() == 1 and re.search(text, legend.inner_text()))
        wait_for_frames(page, 2)
        save_screenshot(page, f"colour_{choice}")
    colours.get_by_text("own", exact=True).click()
    until(lambda: legend.count() == 0)
    page.keyboard.press("Escape")


def test_the_distribution_of_distances_is_plotted(page):
    plots = open_panel(page, "Plots")
    plots.get_by_role("button", name="Distances", exact=True).click()
    line = plots.locator("[data-line=distances]")
    until(lambda: re.search(r"min \d+\.\d+ m, median \d+\.\d+ m", line.inner_text()))
    save_screenshot(page, "plot_distances")
    nearest = until(lambda: table_of(page, plots))
    assert 0.0 < float(re.search(r"min ([\d.]+)", line.inner_text())[1]) < SPACING_M + 0.5
    plots.get_by_text("All pairs").click()
    until(lambda: (table := table_of(page, plots)) and table[-1][1] > 2 * nearest[-1][1])
    save_screenshot(page, "plot_distances_pairs")
    plots.get_by_role("button", name="Remove plot").first.click()
    panel_button(page, "Plots").click()


def table_of(page, plots):
    """Rows of the saved distribution: from, to, percent."""
    with page.expect_download() as kept:
        plots.get_by_role("button", name="Download as CSV").click()
    head, *rows = kept.value.path().read_text().splitlines()
    assert head == "from_m,to_m,percent"
    table = [tuple(map(float, row.split(","))) for row in rows]
    assert sum(percent for *_, percent in table) == pytest.approx(100.0)
    return table


def test_a_number_in_json_is_plotted(page, served):
    topic = roslibpy.Topic(served.ros, "/swarm/status", "std_msgs/String")
    topic.advertise()

    def publish():
        topic.publish(roslibpy.Message({"data": json.dumps({"phase": "search", "cost": 0.25})}))
        return True

    panel = open_panel(page, "Topics")
    panel.get_by_label("Filter topics").fill("swarm/status")
    row = panel.get_by_role("listitem", name="/swarm/status", exact=True)
    row.get_by_role("button", name="/swarm/status", exact=True).click()
    cost = row.locator("[data-path='data.cost']")
    until(lambda: publish() and cost.count() == 1)
    assert cost.inner_text() == "0.25000"
    row.get_by_role("button", name="Plot data.cost").click()
    line = page.locator("[data-line='/swarm/status.data.cost']")
    until(lambda: publish() and "0.25000" in line.inner_text())
    save_screenshot(page, "plot_json")
    topic.unadvertise()


def test_a_thousand_uavs(browsing, tmp_path, chromium):
    from page_serving import Served

    path = tmp_path / "crowd.toml"
    path.write_text(crowd(1000))
    with Served(str(path)) as server:
        page = browsing.open(server.url + "#uav=uav990&quality=minimal", viewport=SMALL)
        wait_for_world(page)
        until(lambda: page.evaluate("window.volery.uavs().length") == 1000)
        until(lambda: page.get_by_label("Number of UAVs").inner_text().startswith("1000 UAVs"))
        assert page.get_by_role("option").count() < 40  # rows that are not seen are not made
        wait_for_frames(page, 3)
        save_screenshot(page, "1000_uavs")
        assert page.evaluate("window.volery.drawCalls") < 60
        page.get_by_label("Search UAVs").fill("uav999")
        page.get_by_role("option", name="uav999").click()
        page.get_by_role("option", name="uav999", selected=True).wait_for()
        page.close()  # before its server ends, of which it would complain
