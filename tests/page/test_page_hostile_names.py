"""Names and texts of others are shown and never run: from a robot, a scenario, files and links."""

import json
import urllib.parse
import urllib.request

import pytest
from hostile_robot import LONG, RUN, TEXTS, hostile_robot
from page_browsing import save_screenshot
from page_serving import Served
from working import open_panel, panel_button

pytestmark = pytest.mark.slow

LARGE = {"width": 1280, "height": 800}
IMAGE, SCRIPT = TEXTS[:2]
SCENARIO = f"""
name = "hostile"
description = '''{IMAGE} {SCRIPT} \u202e{"y" * 5000}'''
duration_s = 36000.0
[types.f450]
airframe = "f450"
[[uavs]]
type = "f450"
position_m = [0.0, 0.0]
"""
INJECTED = """() => ({
    ran: window.injected ?? 0,
    images: [...document.images].filter(image => image.getAttribute("src") === "x").length,
    scripts: [...document.scripts].filter(script => !script.src).length,
    links: [...document.querySelectorAll("[href^='javascript:' i]")].length,
    loading: document.querySelectorAll("[onload], [onerror]").length,
})"""
CLEAN = {"ran": 0, "images": 0, "scripts": 0, "links": 0, "loading": 0}
WIDER = (
    "document.documentElement.scrollWidth > innerWidth || document.body.scrollWidth > innerWidth"
)


@pytest.fixture(scope="module")
def robot():
    with hostile_robot() as url:
        yield url


@pytest.fixture(scope="module")
def served(chromium, tmp_path_factory):
    folder = tmp_path_factory.mktemp("hostile")
    (folder / "hostile.toml").write_text(SCENARIO)
    recordings = folder / "recordings"
    recordings.mkdir()
    (recordings / f"{IMAGE}.mcap").write_bytes(b"\x89MCAP0\r\n")
    with Served(str(folder / "hostile.toml"), "--recordings-dir", str(recordings)) as server:
        yield server


def check(page):
    """Nothing has run or come in, and the page is as wide as its window."""
    assert page.evaluate(INJECTED) == CLEAN
    assert not page.evaluate(WIDER)


def test_names_of_a_robot_are_texts(browsing, served, robot):
    browsing.expected.append("Failed to load|WebSocket|503|404")
    page = browsing.open(f"{served.url}?ros={robot}", viewport=LARGE)
    page.get_by_role("listbox", name="UAVs").get_by_text(IMAGE).first.wait_for()
    panel = open_panel(page, "Topics")
    for text in (IMAGE, SCRIPT):
        row = panel.get_by_title(f"/{text}/{TEXTS.index(text)}", exact=True)
        row.click()
        panel.get_by_text(f"javascript:{RUN}").first.wait_for()  # the content of the message
        row.click()
    check(page)
    save_screenshot(page, "hostile_topics")
    for name in ("Log", "Services", "Plots"):
        panel = open_panel(page, name)
        if name != "Plots":
            panel.get_by_text(IMAGE).first.wait_for()
        check(page)
    save_screenshot(page, "hostile_log")
    panel = open_panel(page, "Services")
    panel.get_by_role("button", name=f"/{IMAGE}/service", exact=True).click()
    panel.get_by_text(IMAGE).nth(1).wait_for()
    page.get_by_role("button", name="Cameras (P)").click()
    page.get_by_role("button", name="Layers", exact=True).click()
    page.get_by_role("checkbox", name="Coordinate frames").check()
    page.keyboard.press("Escape")
    check(page)
    save_screenshot(page, "hostile_robot")
    panel_button(page, "Topics").click()  # the page still obeys
    open_panel(page, "Topics").get_by_placeholder("Filter by name or type").wait_for()


def test_names_of_scenarios_recordings_and_uploads_are_texts(browsing, served):
    browsing.expected.append("Failed to load|415|422")
    assert json.loads(served.fetch("recordings")) == []  # the server offers no such name
    page = browsing.open(served.url, viewport=LARGE)
    page.get_by_label("Simulated time").wait_for()
    names = [IMAGE, "\u202epac", "javascript:0", "';window.injected=1;'", LONG]
    files = [{"name": f"{name}.mcap", "bytes": 9, "seconds": 1.0, "kind": "mcap"} for name in names]
    page.route("**/api/recordings", lambda route: route.fulfill(json=files))
    panel = open_panel(page, "Recordings")
    panel.get_by_text(f"{IMAGE}.mcap").wait_for()
    panel.get_by_role("button", name=f"Play {IMAGE}.mcap").click()
    page.get_by_role("alert").filter(has_text="Playback failed").first.wait_for()
    check(page)
    save_screenshot(page, "hostile_recordings")
    page.get_by_role("button", name="Scenario hostile").click()
    dialog = page.get_by_role("dialog")
    dialog.get_by_text(IMAGE).first.wait_for()
    check(page)
    dialog.locator("input[type=file]").set_input_files(
        {"name": f"{IMAGE}{SCRIPT.replace('/', '')}.csv", "mimeType": "", "buffer": b"0,2\n"}
    )
    page.get_by_role("radio", name="Grid map").check()
    page.get_by_role("button", name="Upload", exact=True).click()
    page.get_by_role("alert").filter(has_text="line 1, column 2").wait_for()
    check(page)
    save_screenshot(page, "hostile_upload")
    page.keyboard.press("Escape")
    page.get_by_role("button", name="Pause", exact=True).click()
    page.get_by_role("button", name="Play", exact=True).wait_for()
    page.get_by_role("button", name="Play", exact=True).click()


def test_names_of_trainings_are_texts(browsing, served, tmp_path):
    writing = pytest.importorskip("tensorboard.summary.writer.event_file_writer")
    from tensorboard.compat.proto.event_pb2 import Event
    from tensorboard.compat.proto.summary_pb2 import Summary

    browsing.expected.append("font-roboto")
    for step, run in enumerate((IMAGE, "{{constructor.constructor('window.injected=1')()}}")):
        writer = writing.EventFileWriter(str(tmp_path / run))
        value = Summary.Value(tag=f"{SCRIPT}{run}", simple_value=1.0)
        writer.add_event(Event(step=step, wall_time=1.0, summary=Summary(value=[value])))
        writer.close()
    with Served("hover", "--tensorboard", str(tmp_path)) as server:
        page = browsing.open(server.url, viewport=LARGE)
        frame = open_panel(page, "TensorBoard").frame_locator("iframe")
        frame.get_by_text("window.injected").first.wait_for()
        inside = page.frames[-1]
        assert "tensorboard" in inside.url
        assert (
            inside.evaluate(INJECTED) | {"scripts": 0} == CLEAN
        )  # its page has scripts of its own
        check(page)
        save_screenshot(page, "hostile_trainings")
        page.context.close()


@pytest.mark.parametrize("key", ["uav", "scenario", "camera", "view", "quality"])
def test_links_carry_no_script(browsing, served, key):
    for text in (IMAGE, f"javascript:{RUN}", LONG):
        page = browsing.open(f"{served.url}#{urllib.parse.urlencode({key: text})}", viewport=LARGE)
        page.get_by_label("Simulated time").wait_for()
        check(page)
        page.context.close()


def test_a_scripts_sources_are_the_servers_own(served):
    with urllib.request.urlopen(served.url, timeout=60.0) as response:
        policy = response.headers["Content-Security-Policy"]
    rules = dict(rule.strip().split(" ", 1) for rule in policy.split(";"))
    assert rules["script-src"] == "'self'"
    assert rules["default-src"] == "'self'"
    assert rules["object-src"] == rules["base-uri"] == "'none'"
    assert rules["frame-ancestors"] == rules["form-action"] == "'self'"
