"""Rights on the page: tokens and roles, and two operators that share the UAVs."""

import json
import urllib.error
import urllib.request

import numpy as np
import pytest
import roslibpy
from page_browsing import save_screenshot
from page_serving import Served
from scene_reading import on_screen, wait_for_world, wait_until
from truth import hurried, pass_seconds, position_of, until, vehicle
from working import WIDE, inspect, open_panel

pytestmark = pytest.mark.slow

OPERATORS, VIEWERS = "pilots-secret-token", "viewers-secret-token"
WHY_NOT = "View-only access: commands require an operator token"
LOOK = "#view=fly&camera=-9_0_6_0_-0.3_0&uav=uav1"
ASK = """
(order) => new Promise((resolve, reject) => {
  const socket = new WebSocket(new URL("./rosbridge", location.href));
  socket.onerror = () => reject(new Error("no socket"));
  socket.onopen = () => socket.send(JSON.stringify(order));
  socket.onmessage = ({ data }) => resolve(JSON.parse(data));
})
"""
"""Sends one operation past the page's own controls, with the browser's cookie."""


@pytest.fixture(scope="module")
def served(chromium):
    with Served("hover", "--uavs", "2", "--viewer-token", VIEWERS, token=OPERATORS) as server:
        with hurried(server):
            for uav in ("uav1", "uav2"):
                vehicle(server, uav, lambda state: state["mode"] == "HOLD")
        yield server


def enter(browsing, served, token):
    page = browsing.open(f"{served.url}?token={token}{LOOK}", viewport=WIDE)
    page.get_by_role("option", name="uav1").wait_for()
    assert "token" not in page.url  # the cookie carries it now
    return page


def test_without_a_token_the_page_asks_for_one(browsing, served):
    browsing.expected += ["401", "403", "WebSocket connection"]
    page = browsing.open(served.url, viewport=WIDE)
    page.get_by_text("This server requires a token").wait_for()
    assert page.get_by_role("option", name="uav1").count() == 0
    save_screenshot(page, "token")
    page.get_by_label("Token").fill("wrong")
    page.get_by_role("button", name="Connect").click()
    page.get_by_text("The server does not accept this token").wait_for()
    page.get_by_label("Token").fill(OPERATORS)
    page.get_by_role("button", name="Connect").click()
    page.get_by_role("option", name="uav1").wait_for()
    assert "token" not in page.url
    with pytest.raises(urllib.error.HTTPError, match=r"HTTP Error 40[13]"):
        served.fetch("world.glb", query="")


def test_a_viewer_sees_all_and_every_control_is_off(browsing, served):
    page = enter(browsing, served, VIEWERS)
    wait_for_world(page)
    assert json.loads(served.fetch("status", f"?token={VIEWERS}"))["role"] == "viewer"
    panel = inspect(page, "uav1")
    buttons = panel.get_by_role("group", name="Commands")
    for name in ("Take off", "Land", "Hold", "Return", "Arm", "Kill"):
        assert buttons.get_by_role("button", name=name, exact=True).is_disabled()
    for name in ("Go", "Go to a clicked position", "Take control", "Remove uav1"):
        assert panel.get_by_role("button", name=name, exact=True).is_disabled()
    for name in ("Pause", "Reset", "Manual control"):
        assert page.get_by_role("button", name=name, exact=True).is_disabled()
    open_panel(page, "Environment").get_by_text(WHY_NOT).wait_for()
    assert page.get_by_role("button", name="Add a gust").is_disabled()
    assert page.get_by_role("slider").count() == 0  # none has a thumb
    assert open_panel(page, "Faults").get_by_role("button", name="Inject").is_disabled()
    assert page.get_by_role("button", name="Send the selected UAV by click").is_disabled()
    save_screenshot(page, "viewer")
    # What moves, moves for him too.
    z = on_screen(page, "uav1")["position"][2]
    request = {"position": {"x": 0.0, "y": 0.0, "z": z + 2.0}, "keep_heading": True}
    served.call("/uav1/go_to", "volery_interfaces/srv/GoTo", request)
    wait_until(page, lambda page: on_screen(page, "uav1")["position"][2] > z + 1.0)


def test_a_viewers_keys_command_nothing(browsing, served):
    page = enter(browsing, served, VIEWERS)
    page.keyboard.press("l")
    page.get_by_role("alert").filter(has_text=WHY_NOT).first.wait_for()
    page.keyboard.press("c")
    assert page.get_by_role("group", name="Manual control").count() == 0
    assert vehicle(served, "uav1")["mode"] != "LAND"


def test_the_server_refuses_a_viewer_whatever_his_page_does(browsing, served):
    page = enter(browsing, served, VIEWERS)
    order = {"op": "call_service", "service": "/uav2/land", "type": "std_srvs/srv/Trigger"}
    response = page.evaluate(ASK, order)
    assert response.get("result") is False or response["op"] == "status"
    assert "viewer" in json.dumps(response)
    twist = {"linear": {"x": 3.0, "y": 0.0, "z": 0.0}}
    publish = {"op": "publish", "topic": "/uav2/cmd_vel", "msg": twist}
    response = page.evaluate(ASK, publish | {"type": "geometry_msgs/msg/Twist"})
    assert "viewer" in json.dumps(response)
    state = vehicle(served, "uav2")
    assert state["mode"] == "HOLD"
    assert state["command_age"] < 0
    upload = "api/uploads?kind=grid_map&name=a.csv"
    status = "(url) => fetch('./' + url, {method: 'POST', body: '0,1'}).then((r) => r.status)"
    browsing.expected += ["403"]
    assert page.evaluate(status, upload) == 403


def test_two_operators_and_a_hand_over(browsing, served):
    anna, ben = enter(browsing, served, OPERATORS), enter(browsing, served, OPERATORS)
    annas, bens = inspect(anna, "uav1"), inspect(ben, "uav1")
    annas.get_by_label("Your name").fill("Anna")
    annas.get_by_role("button", name="Take control").click()
    vehicle(served, "uav1", lambda uav: uav["operator"] == "Anna")
    bens.get_by_text("Anna controls this UAV: the server refuses your commands.").wait_for()
    # Ben takes the other one, by which Anna's page knows him.
    inspect(ben, "uav2").get_by_label("Your name").fill("Ben")
    bens.get_by_role("button", name="Take control").click()
    vehicle(served, "uav2", lambda uav: uav["operator"] == "Ben")
    inspect(ben, "uav1").get_by_role("button", name="Land", exact=True).click()
    ben.get_by_role("alert").filter(has_text="held by Anna").first.wait_for()
    assert vehicle(served, "uav1")["mode"] != "LAND"
    ben.keyboard.press("c")
    ben.get_by_role("group", name="Manual control").get_by_text("Anna controls uav1").wait_for()
    ben.keyboard.down("KeyW")
    pass_seconds(served, 1.0)
    ben.keyboard.up("KeyW")
    assert vehicle(served, "uav1")["mode"] != "VELOCITY"
    ben.keyboard.press("Escape")
    save_screenshot(ben, "held_by_another")
    annas.get_by_label("New operator").fill("Ben")
    anna.keyboard.press("Escape")  # the list of names
    annas.get_by_role("button", name="Hand over").click()
    vehicle(served, "uav1", lambda uav: uav["operator"] == "Ben")
    annas.get_by_text("Ben controls this UAV: the server refuses your commands.").wait_for()
    bens.get_by_text("You control this UAV as Ben.").wait_for()
    x = position_of(served, "uav1")[0]
    ben.keyboard.press("c")
    ben.keyboard.down("KeyW")
    vehicle(served, "uav1", lambda uav: uav["mode"] == "VELOCITY" and uav["position"]["x"] > x + 1)
    ben.keyboard.up("KeyW")
    with pytest.raises(roslibpy.core.ServiceException, match="held by Ben"):
        served.call("/uav1/hold", "std_srvs/srv/Trigger")
    ben.context.close()  # an operator that leaves releases control
    vehicle(served, "uav1", lambda uav: uav["operator"] == "")
    until(lambda: np.isclose(vehicle(served, "uav1")["velocity"]["x"], 0.0, atol=0.2))
