"""Panels of data: they show what the simulation publishes, and their requests take effect."""

import json
import re

import pytest
from page_browsing import save_screenshot
from truth import collect_vehicles, of_uav, pass_seconds, position_of, until
from working import WIDE, choose, open_panel

pytestmark = pytest.mark.slow

ODOMETRY = "nav_msgs/msg/Odometry"


@pytest.fixture(scope="module")
def recordings(tmp_path_factory):
    return tmp_path_factory.mktemp("recordings")


@pytest.fixture(scope="module")
def served(recordings, chromium):
    from page_serving import Served

    with Served("hover", "--recordings-dir", str(recordings), "--uavs", "2") as server:
        yield server


@pytest.fixture(scope="module")
def opened(module_browsing, served):
    return module_browsing.open(served.url, viewport=WIDE)


@pytest.fixture
def page(opened, shared):
    return opened


def number(text):
    return float(re.search(r"-?\d+(\.\d+)?", text)[0])


def test_a_topic_unfolds_with_its_rate_and_live_values(page, served):
    panel = open_panel(page, "Topics")
    panel.get_by_label("Filter topics").fill("uav1/odom")
    row = panel.get_by_role("listitem", name="/uav1/odom", exact=True)
    assert row.locator("[data-kind=rate]").inner_text() == ""  # nothing is received unasked
    row.get_by_role("button", name="/uav1/odom", exact=True).click()
    height = row.locator("[data-path='pose.pose.position.z']")
    height.wait_for()
    until(lambda: number(row.locator("[data-kind=rate]").inner_text() or "0") > 0)
    odometry = served.once("/uav1/odom", ODOMETRY)
    assert number(height.inner_text()) == pytest.approx(
        odometry["pose"]["pose"]["position"]["z"], abs=0.5
    )
    assert number(row.locator("[data-kind=size]").inner_text()) > 0
    save_screenshot(page, "topics")


def test_a_form_publishes_what_a_subscriber_receives(page, served):
    panel = open_panel(page, "Topics")
    panel.get_by_label("Filter topics").fill("uav2/cmd_vel Twist")
    row = panel.get_by_role("listitem", name="/uav2/cmd_vel", exact=True)
    row.get_by_role("button", name="/uav2/cmd_vel", exact=True).click()
    row.get_by_role("button", name="Publish", exact=True).click()
    row.get_by_label("z", exact=True).first.fill("0.25")
    send = row.get_by_role("button", name="Publish to /uav2/cmd_vel")
    before = served.once("/volery/vehicles", "volery_interfaces/msg/VehicleStates")
    assert before["vehicles"][1]["command_age"] < 0
    send.click()
    served.once(
        "/volery/vehicles",
        "volery_interfaces/msg/VehicleStates",
        lambda message: message["vehicles"][1]["command_age"] >= 0,
    )


def test_a_plot_draws_a_field_and_keeps_it_as_csv(page):
    panel = open_panel(page, "Plots")
    panel.get_by_label("Topic of a new line").click()
    panel.get_by_label("Topic of a new line").fill("/uav1/odom")
    page.get_by_role("option", name="/uav1/odom", exact=True).click()
    panel.get_by_label("Field of a new line").click()
    panel.get_by_label("Field of a new line").fill("pose.pose.position.z")
    page.get_by_role("option", name="pose.pose.position.z", exact=True).click()
    line = panel.locator("[data-line='/uav1/odom.pose.pose.position.z']")
    until(lambda: re.search(r" \d", line.inner_text()))
    save_screenshot(page, "plots")
    head, *rows = until(lambda: csv_of(page, panel, 10))
    assert head == "time_s,/uav1/odom.pose.pose.position.z"
    times = [float(row.split(",")[0]) for row in rows]
    assert times == sorted(times)
    assert all(-1.0 < float(row.split(",")[1]) < 5.0 for row in rows)


def csv_of(page, panel, min_rows):
    """Lines of the plot's file once it has more than so many values, or None."""
    with page.expect_download() as kept:
        panel.get_by_role("button", name="Download as CSV").click()
    lines = kept.value.path().read_text().splitlines()
    return lines if len(lines) > min_rows + 1 else None


def test_a_service_is_called_by_a_form_of_its_own(page, served):
    panel = open_panel(page, "Services")
    panel.get_by_label("Filter services").fill("uav1/take_off_to")
    panel.get_by_role("button", name="/uav1/take_off_to", exact=True).click()
    form = panel.get_by_role("form", name="Call /uav1/take_off_to")
    form.get_by_label("altitude").fill("3")
    form.get_by_role("button", name="Call", exact=True).click()
    response = form.get_by_role("region", name="Response")
    response.locator("[data-path=message]").wait_for()
    save_screenshot(page, "services")
    assert response.locator("[data-path=success]").inner_text() in ("true", "false")


def test_a_fault_is_injected_and_shown_in_the_log(page, served):
    panel = open_panel(page, "Faults")
    panel.get_by_label("Fault type").click()
    page.get_by_role("option", name="Displacement").click()
    for axis, metres in (("east", "3"), ("north", "0"), ("up", "1")):
        panel.get_by_label(f"Offset, m, {axis}").fill(metres)
    x = position_of(served, "uav1")[0]
    with collect_vehicles(served) as received:
        panel.get_by_role("button", name="Inject").click()
        until(lambda: any(uav["position"]["x"] > x + 2.0 for uav in of_uav(received, "uav1")))
    log = open_panel(page, "Log")
    log.get_by_role("log").get_by_text("fault", exact=True).first.wait_for()
    save_screenshot(page, "log")
    log.get_by_label("Filter the log").fill("nothing is called so")
    assert log.get_by_role("log").inner_text() == ""


def test_a_wrong_fault_shows_why(page):
    panel = open_panel(page, "Faults")
    panel.get_by_label("Rotor", exact=True).fill("99")
    panel.get_by_role("button", name="Inject").click()
    page.get_by_text("Fault injection failed").wait_for()


def test_an_active_fault_is_listed_and_can_be_ended(page):
    panel = open_panel(page, "Faults")
    choose(page, panel.get_by_role("combobox", name="Fault type"), "Sensor")
    choose(page, panel.get_by_role("combobox", name="UAV"), "uav2")
    panel.get_by_role("button", name="Inject").click()
    badge = page.get_by_role("option", name="uav2").get_by_label("Fault: imu dropped")
    badge.wait_for()
    save_screenshot(page, "active_fault")
    listed = panel.get_by_role("list", name="Active faults").get_by_role("listitem")
    assert re.match(r"uav2 imu dropped . since \d", listed.inner_text())
    listed.get_by_role("button", name="End imu dropped of uav2").click()
    badge.wait_for(state="detached")
    listed.wait_for(state="detached")


@pytest.mark.parametrize("name", ["from_the_page.mcap", "from_the_page.bag"])
def test_a_flight_is_recorded_listed_fetched_and_brought_again(page, served, recordings, name):
    panel = open_panel(page, "Recordings")
    panel.get_by_label("Name of the recording").fill(name)
    panel.get_by_role("button", name="Record", exact=True).click()
    panel.get_by_role("button", name="Stop").wait_for()
    pass_seconds(served, 1.0)
    panel.get_by_role("button", name="Stop").click()
    row = panel.get_by_role("row", name=re.compile(f"^{name}"))
    row.wait_for()
    with page.expect_download() as kept:
        row.get_by_role("link", name=f"Download {name}").click()
    content = kept.value.path().read_bytes()
    assert content == (recordings / name).read_bytes()
    save_screenshot(page, "recordings")
    with page.expect_file_chooser() as chosen:
        panel.get_by_role("button", name="Upload a log").click()
    chosen.value.set_files({"name": f"brought_{name}", "mimeType": "", "buffer": content})
    panel.get_by_role("button", name=f"Play brought_{name}").wait_for()
    assert (recordings / f"brought_{name}").read_bytes() == content


def test_the_meter_shows_age_load_and_memory(page):
    meter = page.get_by_role("button", name=re.compile("^Health"))
    until(lambda: re.search(r"\d+ m?s", meter.get_attribute("aria-label")))
    meter.click()
    details = page.get_by_role("dialog", name="Health")
    details.get_by_text("advance vehicles").wait_for()
    save_screenshot(page, "health")
    assert "MB" in details.inner_text()


def test_the_layout_is_kept_for_the_next_visit(page):
    open_panel(page, "Log")
    page.reload()
    page.get_by_role("complementary", name="Log").wait_for()
    assert json.loads(page.evaluate("localStorage.getItem('volery.layout')"))["bottom"] == "log"


def test_a_recording_is_played_with_a_slider_and_left_again(page, served, shared):
    shared.expected += ["WebSocket connection", "Failed to load"]  # while the worlds change
    panel = open_panel(page, "Recordings")
    panel.get_by_label("Name of the recording").fill("to_be_played")
    panel.get_by_role("button", name="Record", exact=True).click()
    panel.get_by_role("button", name="Stop").wait_for()
    pass_seconds(served, 2.0)
    panel.get_by_role("button", name="Stop").click()
    panel.get_by_role("button", name="Play to_be_played.mcap").click()
    player = page.get_by_role("group", name="Playback")
    player.wait_for()
    until(lambda: player.get_by_role("button", name="Play the recording").is_visible())  # its end
    slider = player.get_by_role("slider")
    slider.focus()
    page.keyboard.press("Home")
    start = float(slider.get_attribute("aria-valuemin"))
    until(lambda: float(slider.get_attribute("aria-valuenow")) < start + 0.2)
    save_screenshot(page, "player")
    player.get_by_role("button", name="Play the recording").click()
    until(lambda: float(slider.get_attribute("aria-valuenow")) > start + 0.2)
    page.get_by_label("Link: playback").wait_for()
    panel = open_panel(page, "Recordings")
    assert panel.get_by_role("button", name="Record", exact=True).is_disabled()
    assert panel.get_by_role("button", name="Play to_be_played.mcap").is_enabled()
    player.get_by_role("button", name="Close the recording").click()
    player.wait_for(state="detached")
    until(lambda: served.status()["state"] == "flying")
    page.get_by_label("Simulated time").wait_for()
