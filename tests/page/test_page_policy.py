"""The policy that flies a UAV: its observation, its action and its value, live."""

import re

import pytest
from page_browsing import save_screenshot
from truth import until
from working import WIDE, open_panel

pytestmark = pytest.mark.slow

SCENARIO = "policy_homing"


def test_the_panel_shows_what_the_policy_observes_and_does(browsing, served):
    page = browsing.open(served.url + "#uav=uav1", viewport=WIDE)
    panel = open_panel(page, "Policy")
    panel.get_by_text("flying").wait_for()
    panel.get_by_text("task homing, trained with f450, 5 Hz").wait_for()
    goal = panel.get_by_role("region", name="goal_heading")
    until(lambda: re.search(r"x\s+-?\d+\.\d\d m", goal.inner_text()))
    action = panel.get_by_role("region", name="Action")
    until(lambda: re.search(r"hover|forward|back|left|right|up|down", action.inner_text()))
    value = panel.get_by_role("region", name="Value")
    until(lambda: re.search(r"return: -?\d+\.\d\d", value.inner_text()))
    until(lambda: " " in (value.locator("polyline").get_attribute("points") or ""))
    save_screenshot(page, "policy")
