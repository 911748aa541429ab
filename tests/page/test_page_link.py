"""What the page says and does when the link breaks, the server restarts or the world is large."""

import asyncio
import json
import os
import re
import signal
import threading
import time

import pytest
from page_browsing import save_screenshot
from page_serving import Served
from reverse_proxy import ReverseProxy
from truth import until

pytestmark = pytest.mark.slow

WIDE = {"width": 1000, "height": 600}


@pytest.fixture(scope="module")
def served(chromium):
    with Served("hover") as server:
        yield server


def clock_s(page):
    minutes, seconds = page.get_by_label("Simulated time").inner_text().split(":")
    return 60 * int(minutes) + float(seconds)


def wait_for_clock(page, fits, timeout_s=600.0):
    ends = time.monotonic() + timeout_s
    while not fits(clock_s(page)):
        assert time.monotonic() < ends, f"the page's clock shows {clock_s(page)} s"
        time.sleep(0.1)


def test_silence_is_shown_at_once_and_ends_by_itself(browsing, served):
    page = browsing.open(served.url)
    wait_for_clock(page, lambda s: s > 0)
    os.kill(served.pid, signal.SIGSTOP)
    try:
        banner = page.get_by_role("alert").filter(has_text="No data from the simulation")
        banner.wait_for()
        save_screenshot(page, "silent")
        assert "Since" in banner.inner_text()
    finally:
        os.kill(served.pid, signal.SIGCONT)
    banner.wait_for(state="detached")


def test_the_page_comes_back_with_the_server(browsing, served):
    browsing.expected += ["ERR_CONNECTION_REFUSED", "WebSocket connection", "Failed to load", "503"]
    page = browsing.open(served.url, viewport=WIDE)
    wait_for_clock(page, lambda s: s > 1)
    page.get_by_role("navigation").get_by_role("button", name="Topics", exact=True).click()
    page.get_by_label("Filter topics").fill("uav1/odom")
    row = page.get_by_role("listitem", name="/uav1/odom", exact=True)
    row.get_by_role("button", name="/uav1/odom", exact=True).click()
    row.locator("[data-path='pose.pose.position.z']").wait_for()
    # a server that stops reports "building" in its last second
    building = json.dumps(served.status() | {"state": "building"})
    page.route("**/api/status", lambda route: route.fulfill(body=building))
    page.get_by_role("heading", name="Building").wait_for()
    served.stop()
    page.unroute("**/api/status")
    banner = page.get_by_role("alert").filter(has_text="No connection")
    banner.wait_for()
    save_screenshot(page, "link_lost")
    shown = row.locator("[data-path='pose.pose.position.z']").inner_text()
    assert shown  # the last that came stays
    served.start()
    banner.wait_for(state="detached")
    before = clock_s(page)
    wait_for_clock(page, lambda s: s != before)
    # what was subscribed comes again
    rate = row.locator("[data-kind=rate]")
    until(lambda: re.match(r"[1-9]", rate.inner_text()))


def test_below_a_prefix_of_a_reverse_proxy(browsing, served):
    with ReverseProxy("/lab/uavs", served.port) as proxy:
        page = browsing.open(proxy.url)
        wait_for_clock(page, lambda s: s > 0)
        before = clock_s(page)
        wait_for_clock(page, lambda s: s > before)
        assert proxy.outside == []  # nothing was asked for beside the prefix
        page.close()  # before the proxy: a page without its server complains


def test_two_browsers_see_the_same_flight(browsing, served):
    first, second = browsing.open(served.url), browsing.open(served.url)
    wait_for_clock(first, lambda s: s > 0)
    wait_for_clock(second, lambda s: s > 0)
    first.get_by_role("button", name=re.compile("^Pause")).first.click()
    second.get_by_role("button", name=re.compile("^Play")).first.wait_for()
    until(lambda: clock_s(first) == pytest.approx(clock_s(second), abs=0.2))
    second.get_by_role("button", name=re.compile("^Play")).first.click()
    first.get_by_role("button", name=re.compile("^Pause")).first.wait_for()


def test_a_topic_of_unknown_type_is_listed_and_harms_nothing(browsing, chromium):
    """A robot's rosbridge with a type of its own, at which the page is pointed by `?ros=`."""
    from websockets.asyncio.server import serve as serve_sockets

    from volery.server.page import STATIC

    started, ports, stop = threading.Event(), [], threading.Event()

    async def respond(socket):
        import json

        async for text in socket:
            operation = json.loads(text)
            if operation["op"] == "call_service":
                values = {"topics": ["/gripper"], "types": ["acme_msgs/msg/Gripper"]}
                ok = operation["service"] == "/rosapi/topics"
                reply = {"op": "service_response", "service": operation["service"], "result": ok}
                reply |= {"id": operation.get("id"), "values": values if ok else "there is no such"}
                await socket.send(json.dumps(reply))
            elif operation["op"] == "subscribe" and operation["topic"] == "/gripper":
                force = {"force": 4.5, "names": ["left", "right"]}
                publication = {"op": "publish", "topic": "/gripper", "msg": force}
                await socket.send(json.dumps(publication))

    async def run():
        async with serve_sockets(respond, "127.0.0.1", 0) as server:
            ports.append(server.sockets[0].getsockname()[1])
            started.set()
            while not stop.is_set():
                await asyncio.sleep(0.05)

    thread = threading.Thread(target=lambda: asyncio.run(run()))
    thread.start()
    assert started.wait(180)
    try:
        with ReverseProxy("", None, folder=STATIC) as proxy:
            page = browsing.open(f"{proxy.url}?ros=ws://127.0.0.1:{ports[0]}", viewport=WIDE)
            page.get_by_role("navigation").get_by_role("button", name="Topics", exact=True).click()
            row = page.get_by_role("listitem", name="/gripper", exact=True)
            row.get_by_role("button", name="/gripper", exact=True).click()
            force = row.locator("[data-path=force]")
            force.wait_for()
            assert force.inner_text() == "4.50000"
            save_screenshot(page, "unknown_type")
    finally:
        stop.set()
        thread.join()


def test_256_uavs(browsing, tmp_path):
    from volery_benchmarks.page.worlds import crowd

    path = tmp_path / "crowd.toml"
    path.write_text(crowd(256))
    with Served(str(path)) as server:
        page = browsing.open(server.url, viewport=WIDE)
        wait_for_clock(page, lambda s: s > 1)
        page.get_by_role("navigation").get_by_role("button", name="Topics", exact=True).click()
        page.get_by_label("Filter topics").fill("uav256/odom")
        row = page.get_by_role("listitem", name="/uav256/odom", exact=True)
        row.get_by_role("button", name="/uav256/odom", exact=True).click()
        row.locator("[data-path='pose.pose.position.z']").wait_for()
        save_screenshot(page, "256_uavs")
        assert page.evaluate("window.volery.uavs().length") == 256
        page.get_by_label("Search UAVs").fill("uav25")
        rows = page.get_by_role("option")
        until(lambda: rows.count() == 8)  # 25 and 250 to 256
        rows.last.click()
        page.get_by_role("option", name="uav256", selected=True).wait_for()
        page.close()  # before its server ends, of which it would complain
