"""What the page steers: each control is worked, and its effect looked up on the graph."""

import pytest
import roslibpy
from page_browsing import save_screenshot
from scene_reading import wait_until
from truth import (
    VEHICLES,
    collect_statuses,
    collect_vehicles,
    first_after_return,
    hurried,
    of_uav,
    position_of,
    put,
    set_speed,
    stamp_ns,
    status,
    until,
    vehicle,
    weather,
)
from working import WIDE, inspect, open_panel, set_slider, tab_to

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def served(tmp_path_factory, chromium):
    from page_serving import Served

    folder = tmp_path_factory.mktemp("recordings")
    with Served("hover", "--recordings-dir", str(folder), "--uavs", "3") as server:
        yield server


@pytest.fixture(scope="module")
def opened(module_browsing, served):
    page = module_browsing.open(served.url, viewport=WIDE)
    page.get_by_role("option", name="uav1").wait_for()
    return page


@pytest.fixture
def page(opened, shared):
    return opened


# ------------------------------------------------------------------------------------------- time


def test_pause_step_and_play(page, served):
    page.get_by_role("button", name="Pause", exact=True).click()
    paused = status(served, lambda state: state["state"] == 2)
    page.get_by_role("button", name="Step", exact=True).click()
    stepped = status(served, lambda state: state["stamp"] != paused["stamp"])
    ns = [stamp_ns(state) for state in (paused, stepped)]
    assert 0 < ns[1] - ns[0] <= 4_000_000  # one physics step
    page.get_by_role("button", name="Multiple steps").click()
    page.get_by_label("Physics steps").fill("500")
    page.get_by_role("dialog").get_by_role("button", name="Step", exact=True).click()
    status(served, lambda state: stamp_ns(state) == ns[1] + 500 * (ns[1] - ns[0]))
    page.keyboard.press("Escape")
    page.get_by_role("button", name="Play", exact=True).click()
    status(served, lambda state: state["state"] == 1)


def test_the_speed_slider_goes_from_slow_to_unbounded(page, served):
    page.get_by_role("button", name="Speed").click()
    set_slider(page, "Speed", "Home", 1)
    status(served, lambda state: state["speed"] == pytest.approx(0.1))
    set_slider(page, "Speed", "End", 1)
    status(served, lambda state: state["speed"] == 0.0)
    page.keyboard.press("Escape")
    set_speed(served, 1.0)


def test_a_snapshot_is_taken_returned_to_and_forgotten(page, served):
    page.get_by_role("button", name="Snapshots").click()
    page.get_by_label("Name of the snapshot").fill("before")
    page.get_by_role("button", name="Save", exact=True).click()
    page.get_by_role("button", name="Restore before").wait_for()
    listed = served.call("/volery/list_snapshots", "volery_interfaces/srv/ListSnapshots")
    assert listed["names"] == ["before"]
    kept_s = listed["stamps"][0]["sec"]
    with hurried(served):
        status(served, lambda state: state["stamp"]["sec"] >= kept_s + 3)
    with collect_statuses(served) as received:
        page.get_by_role("button", name="Restore before").click()
        restored = until(lambda: first_after_return(received))
    assert kept_s <= restored["stamp"]["sec"] <= kept_s + 2
    page.get_by_role("button", name="Delete before").click()
    page.get_by_text("No snapshots.").wait_for()


def test_a_reset_goes_back_to_the_start(page, served):
    with hurried(served):
        status(served, lambda state: state["stamp"]["sec"] >= 3)
    page.get_by_role("button", name="Reset", exact=True).click()
    with collect_statuses(served) as received:
        page.get_by_role("button", name="Reset, same seed").click()
        started = until(lambda: first_after_return(received))
    assert started["stamp"]["sec"] <= 2


# ------------------------------------------------------------------------------------------- UAVs


def test_commands_and_a_position_to_go_to(page, served):
    panel = inspect(page, "uav1")
    with hurried(served):
        vehicle(served, "uav1", lambda uav: uav["mode"] == "HOLD")  # after its own take-off
    panel.get_by_label("x, m").fill("6")
    panel.get_by_label("y, m").fill("-3")
    panel.get_by_label("z, m").fill("4")
    panel.get_by_role("button", name="Go", exact=True).click()
    with hurried(served):
        there = vehicle(served, "uav1", lambda uav: abs(uav["position"]["x"] - 6.0) < 0.3)
    assert there["position"]["y"] == pytest.approx(-3.0, abs=1.0)
    panel.get_by_role("button", name="Land", exact=True).click()
    vehicle(served, "uav1", lambda uav: uav["mode"] in ("LAND", "LANDED"))
    save_screenshot(page, "inspector")


def test_return_brings_a_uav_home(page, served):
    with hurried(served):
        vehicle(served, "uav2", lambda uav: uav["mode"] == "HOLD")
    home = position_of(served, "uav2")
    put(served, "uav2", home[0] + 4.0, home[1], home[2])
    panel = inspect(page, "uav2")
    with collect_vehicles(served) as received:
        panel.get_by_role("button", name="Return", exact=True).click()
        until(lambda: any(uav["mode"] == "RETURN" for uav in of_uav(received, "uav2")))
    with hurried(served):
        vehicle(served, "uav2", lambda uav: abs(uav["position"]["x"] - home[0]) < 0.5)
    served.call("/uav2/hold", "std_srvs/srv/Trigger")


def test_a_kill_is_asked_twice(page, served):
    panel = inspect(page, "uav3")
    vehicle(served, "uav3", lambda uav: uav["airborne"])
    panel.get_by_role("button", name="Kill", exact=True).click()
    panel.get_by_role("button", name="Cancel kill").click()
    panel.get_by_role("button", name="Kill", exact=True).click()
    panel.get_by_role("button", name="Stop rotors").click()
    vehicle(served, "uav3", lambda uav: not uav["airborne"])


def test_flight_by_keyboard(page, served):
    page.get_by_role("option", name="uav2").click()
    flying = vehicle(served, "uav2", lambda uav: uav["mode"] == "HOLD")
    page.get_by_role("button", name="Manual control").click()
    page.get_by_role("group", name="Manual control").wait_for()
    page.keyboard.down("KeyW")
    ahead = vehicle(
        served, "uav2", lambda uav: uav["velocity"]["x"] > 1.0 and uav["mode"] == "VELOCITY"
    )
    page.keyboard.up("KeyW")
    vehicle(served, "uav2", lambda uav: abs(uav["velocity"]["x"]) < 0.2)
    page.keyboard.press("Escape")
    page.get_by_role("group", name="Manual control").wait_for(state="hidden")
    assert ahead["position"]["x"] > flying["position"]["x"]


SLOW_FRAMES = """
() => {
  const work = (ms) => { for (const from = performance.now(); performance.now() - from < ms; ); };
  window.slow = setInterval(() => work(700), 710);
}
"""
HANG = """
() => {
  clearInterval(window.slow);
  setTimeout(() => {
    const request = new XMLHttpRequest();
    request.open("GET", "./hang", false);
    request.send();
  }, 0);
}
"""
"""The page's script stands still until the test answers its request."""


def flies_on(states):
    """Whether the last states, over more than one slow frame, have no hold among them.

    Where another process holds up the page for longer than its commands count, it holds rightly,
    and flies on later. A page without repetitions holds within each frame.
    """
    last = states[-25:]
    return len(last) == 25 and all(
        uav["mode"] == "VELOCITY" and uav["velocity"]["x"] < -2.0 for uav in last
    )


def test_flight_goes_on_while_frames_are_slow_and_ends_when_the_page_hangs(page, served):
    page.get_by_role("option", name="uav2").click()
    vehicle(served, "uav2", lambda uav: uav["airborne"])
    page.keyboard.press("c")
    page.get_by_role("group", name="Manual control").wait_for()
    page.evaluate(SLOW_FRAMES)
    page.keyboard.down("KeyS")
    with collect_vehicles(served) as received:
        until(lambda: flies_on(of_uav(received, "uav2")))
    hanging = []

    def hang(route):  # a plain function: Playwright sets an attribute of it
        hanging.append(route)

    page.route("**/hang", hang)
    page.evaluate(HANG)
    vehicle(served, "uav2", lambda uav: abs(uav["velocity"]["x"]) < 0.2)
    wait_until(page, lambda _: hanging)
    hanging[0].fulfill(body="")
    page.unroute("**/hang")
    vehicle(served, "uav2", lambda uav: uav["velocity"]["x"] < -1.0)  # the key is still down
    page.keyboard.up("KeyS")
    vehicle(served, "uav2", lambda uav: abs(uav["velocity"]["x"]) < 0.2)
    page.keyboard.press("Escape")


def test_a_uav_is_chosen_and_flown_without_a_mouse(page, served):
    vehicle(served, "uav2", lambda uav: uav["mode"] in ("HOLD", "VELOCITY"))
    before = position_of(served, "uav2")
    page.get_by_role("option", name="uav1").click()
    tab_to(page, page.get_by_role("listbox", name="UAVs"))
    page.keyboard.press("ArrowDown")
    page.get_by_role("option", name="uav2", selected=True).wait_for()
    page.keyboard.press("c")
    page.get_by_role("group", name="Manual control").wait_for()
    page.keyboard.down("KeyR")
    vehicle(served, "uav2", lambda uav: uav["position"]["z"] > before[2] + 1.0)
    page.keyboard.up("KeyR")
    vehicle(served, "uav2", lambda uav: abs(uav["velocity"]["z"]) < 0.2)
    page.keyboard.press("Escape")
    page.get_by_role("group", name="Manual control").wait_for(state="hidden")


def test_uavs_come_and_go(page, served):
    page.get_by_role("button", name="Add UAVs").click()
    group = page.get_by_role("group", name="Add UAVs")
    group.get_by_label("Airframe or type").click()
    page.get_by_role("option", name="crazyflie", exact=True).click()
    group.get_by_label("Count", exact=True).fill("2")
    group.get_by_role("button", name="Add", exact=True).click()
    came = vehicle(served, "uav5", lambda uav: True)
    assert came["airframe"] == "crazyflie"
    panel = inspect(page, "uav5")
    panel.get_by_role("button", name="Remove uav5").click()
    served.once(
        "/volery/vehicles",
        VEHICLES,
        lambda message: "uav5" not in [uav["name"] for uav in message["vehicles"]],
    )


def test_control_is_taken_and_let_go(page, served):
    panel = inspect(page, "uav1")
    panel.get_by_label("Your name").fill("Anna")
    panel.get_by_role("button", name="Take control").click()
    vehicle(served, "uav1", lambda uav: uav["operator"] == "Anna")
    with pytest.raises(roslibpy.core.ServiceException, match="held by Anna"):
        served.call("/uav1/hold", "std_srvs/srv/Trigger")
    panel.get_by_text("You control this UAV as Anna.").wait_for()
    panel.get_by_role("button", name="Release control").click()
    vehicle(served, "uav1", lambda uav: uav["operator"] == "")


# ------------------------------------------------------------------------------------------ world


def test_weather_follows_its_sliders(page, served):
    open_panel(page, "Environment")
    set_slider(page, "Rain", "ArrowRight", 8)
    weather(served, lambda state: state["rain"] == pytest.approx(8.0))
    set_slider(page, "Fog", "End", 1)
    weather(served, lambda state: state["fog_visibility"] == pytest.approx(10.0))
    page.get_by_label("Fog now").get_by_text("10 m").wait_for()
    set_slider(page, "Snow", "ArrowRight", 2)
    set_slider(page, "Dust", "End", 1)
    set_slider(page, "Turbulence", "ArrowRight", 6)
    state = weather(served, lambda state: state["w20"] == pytest.approx(3.0))
    assert state["snow"] > 0.0
    assert 0.0 < state["dust_visibility"] < 1000.0
    set_slider(page, "Wind", "ArrowRight", 6)
    state = weather(
        served, lambda state: state["wind"]["y"] == pytest.approx(-3.0)
    )  # from the north
    assert state["rain"] == pytest.approx(8.0)
    page.get_by_role("button", name="Clear weather").click()
    weather(served, lambda state: state["rain"] == state["fog_visibility"] == 0.0)
