"""Expectations on the page: of a flight that goes on, and of a log that is played."""

import re

import pytest
from page_browsing import save_screenshot
from page_serving import Served
from truth import until
from working import SMALL, open_panel

from volery.cluster.single_runs import SingleRun
from volery.scenario.load import load_scenario
from volery.verdicts.judging import Judge

SLOW_M_S, HIGH_M = 0.5, 900.0
SCENARIO = f"""
name = "judged"
duration_s = 4.0

[types.bird]
airframe = "f450"

[[types.bird.sensors]]
kind = "odometry"

[[uavs]]
type = "bird"
position_m = [0.0, 0.0]
on_start = "take_off"

[[expect]]
kind = "no_contact"

[[expect]]
kind = "speed"
at_most_m_s = {SLOW_M_S}

[[expect]]
name = "climbs high"
kind = "formula"
formula = "eventually(z > {HIGH_M})"
"""


@pytest.fixture(scope="module")
def served(chromium, tmp_path_factory):
    folder = tmp_path_factory.mktemp("judged")
    file = folder / "judged.toml"
    file.write_text(SCENARIO, encoding="utf-8")
    scenario = load_scenario(file)
    judge = Judge(scenario)
    with SingleRun(scenario, 20.0, folder / "judged.mcap", judge.needs, judge) as run:
        run.fly()
    with Served(str(file), "--recordings-dir", str(folder)) as server:
        yield server


def outcome(row):
    return row.get_by_role("img").get_attribute("aria-label")


def opened(page, summary):
    """Returns the rows of the list, by the names of the expectations."""
    page.get_by_role("button", name=f"Expectations: {summary}").click()
    rows = page.get_by_role("dialog", name="Expectations").get_by_role("row")
    names = ("no contact", f"speed <= {SLOW_M_S:g} m/s", "climbs high")
    return [rows.filter(has_text=name) for name in names]


def test_a_flight_is_judged_as_it_goes_and_a_log_as_a_whole(browsing, served):
    browsing.expected += ["WebSocket connection", "Failed to load"]  # while the worlds change
    page = browsing.open(served.url + "#quality=minimal", viewport=SMALL)
    contact, speed, climb = opened(page, "1 of 3 met")
    until(lambda: outcome(speed) == "failed")
    assert outcome(contact) == "met"
    assert outcome(climb) == "not yet"  # the flight may still climb
    assert re.search(r"-0\.\d+ m/s", speed.inner_text())
    page.get_by_text("Verdicts on the flight so far").wait_for()
    save_screenshot(page, "verdicts")
    page.keyboard.press("Escape")

    panel = open_panel(page, "Recordings")
    panel.get_by_role("button", name="Play judged.mcap").click()
    player = page.get_by_role("group", name="Playback")
    player.wait_for()
    contact, speed, climb = opened(page, "1 of 3 met")
    page.get_by_text("Verdicts on the whole flight").wait_for()
    assert [outcome(row) for row in (contact, speed, climb)] == ["met", "failed", "failed"]
    save_screenshot(page, "verdicts_playback")
    moment = speed.get_by_role("button", name=re.compile("Go to 0:0"))
    time_s = float(moment.inner_text().partition(":")[2])
    slider = player.get_by_role("slider")
    until(lambda: player.get_by_role("button", name="Play the recording").is_visible())  # its end
    assert float(slider.get_attribute("aria-valuenow")) > time_s + 1.0
    moment.click()
    until(lambda: abs(float(slider.get_attribute("aria-valuenow")) - time_s) < 0.1)
