"""A flight steered by the page alone is recorded, fetched, and flown again by `volery run`."""

import subprocess
import sys

import pytest
from page_serving import Served
from scene_reading import on_screen, wait_for_world, wait_until
from truth import vehicle, weather
from working import WIDE, choose, inspect, open_panel, set_slider

from volery.bridges.logs.recorded_flight import read_flight
from volery.bridges.logs.records import LogWalk

pytestmark = pytest.mark.slow

STATES = ("/ground_truth/tf", "/uav1/odom", "/uav2/odom", "/uav1/imu", "/uav2/imu")
REPEATED_S = 900.0


@pytest.fixture(scope="module")
def served(chromium, tmp_path_factory):
    folder = tmp_path_factory.mktemp("recordings")
    with Served("hover", "--uavs", "2", "--recordings-dir", str(folder)) as server:
        yield server


@pytest.fixture
def page(browsing, served):
    page = browsing.open(served.url + "#uav=uav1", viewport=WIDE)
    wait_for_world(page)
    page.get_by_role("option", name="uav1").wait_for()
    return page


def fly(page, served):
    """Commands, a position to go to, weather, a fault, keys: each is seen to have its effect."""
    panel = inspect(page, "uav1")
    vehicle(served, "uav1", lambda uav: uav["mode"] == "HOLD")
    panel.get_by_role("button", name="Land", exact=True).click()
    vehicle(served, "uav1", lambda uav: uav["mode"] == "LANDED")
    panel.get_by_role("button", name="Arm", exact=True).click()
    panel.get_by_role("button", name="Take off", exact=True).click()
    vehicle(served, "uav1", lambda uav: uav["mode"] == "HOLD" and uav["airborne"])
    for axis, metres in (("x", "3"), ("y", "-2"), ("z", "4")):
        panel.get_by_label(f"{axis}, m").fill(metres)
    panel.get_by_role("button", name="Go", exact=True).click()
    vehicle(served, "uav1", lambda uav: abs(uav["position"]["y"] + 2.0) < 0.3)
    wait_until(page, lambda page: abs(on_screen(page, "uav1")["position"][1] + 2.0) < 0.4)
    open_panel(page, "Environment")
    set_slider(page, "Wind", "ArrowRight", 8)
    weather(served, lambda message: message["wind"]["y"] == pytest.approx(-4.0))
    page.get_by_role("button", name="Add a gust").click()
    fault = open_panel(page, "Faults")
    choose(page, fault.get_by_role("combobox", name="Fault type"), "Rotor")
    choose(page, fault.get_by_role("combobox", name="UAV"), "uav2")
    set_slider(page, "Remaining thrust", "End")
    set_slider(page, "Remaining thrust", "ArrowLeft", 2)
    fault.get_by_role("button", name="Inject").click()
    page.get_by_text("Rotor fault injected").wait_for()
    page.get_by_role("button", name="Manual control").click()
    page.keyboard.down("KeyA")
    vehicle(served, "uav1", lambda uav: uav["mode"] == "VELOCITY" and uav["velocity"]["y"] > 0.7)
    vehicle(served, "uav1", lambda uav: uav["position"]["y"] > 0.0)
    page.keyboard.up("KeyA")
    page.keyboard.press("Escape")
    vehicle(served, "uav1", lambda uav: abs(uav["velocity"]["y"]) < 0.3)


def recorded(page, work):
    """Path of the log that the page has fetched, of what `work` did."""
    panel = open_panel(page, "Recordings")
    panel.get_by_label("Name of the recording").fill("by_page")
    panel.get_by_role("button", name="Record", exact=True).click()
    panel.get_by_role("button", name="Stop").wait_for()
    work()
    panel = open_panel(page, "Recordings")
    panel.get_by_role("button", name="Stop").click()
    link = page.get_by_role("link", name="Download by_page.mcap")
    link.wait_for()
    with page.expect_download() as kept:
        link.click()
    return kept.value.path()


def states(path):
    """What stands in a log of how the world was, by topic and simulated time."""
    return {
        (record.topic.topic, record.time_ns): record.data
        for record in LogWalk(path)
        if record.topic.topic in STATES
    }


def test_replayed_commands_repeat_the_flight_of_the_page(page, served, tmp_path):
    log = tmp_path / "by_page.mcap"
    log.write_bytes(recorded(page, lambda: fly(page, served)).read_bytes())
    names = {command.taken.name for command in read_flight(log).commands}
    assert names >= {
        "/uav1/land",
        "/uav1/arm",
        "/uav1/take_off",
        "/uav1/go_to",
        "/uav1/cmd_vel",
        "/volery/set_weather",
        "/volery/gust",
        "/volery/inject_fault",
    }
    again = tmp_path / "again.mcap"
    words = [sys.executable, "-m", "volery", "run", "hover", "--replay-commands", log]
    done = subprocess.run(
        [*words, "--record", again],
        check=False,
        capture_output=True,
        text=True,
        timeout=REPEATED_S,
    )
    assert done.returncode == 0, done.stderr
    first, second = states(log), states(again)
    topics = {topic for topic, _ in first}
    assert topics == set(STATES)
    assert len(first) > 2000
    wrong = [key for key, data in first.items() if second.get(key) != data]
    assert wrong == []
    # And it is these commands that make it so.
    alone = tmp_path / "alone.mcap"
    seconds = max(time_ns for _, time_ns in first) / 1e9
    words = [sys.executable, "-m", "volery", "run", "hover", "--uavs", "2"]
    words += ["--seconds", str(seconds), "--record", alone]
    subprocess.run(words, check=True, capture_output=True, timeout=REPEATED_S)
    idle = states(alone)
    own = [key for key in first if key in idle and key[0] == "/uav1/odom"]
    assert sum(idle[key] != first[key] for key in own) > 0.5 * len(own) > 50
