"""Takes the README's screenshots of the page: scenarios in headless Chromium.

    python tools/page_screenshots.py [NAME...] [--folder FOLDER]

WebGL is drawn in software, so the simulation is paused until a screenshot is taken.
"""

from __future__ import annotations

import argparse
import json
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from websockets.sync.client import connect

from volery.core.errors import VoleryError
from volery_benchmarks.page.browser import open_browser
from volery_benchmarks.page.looking import wait_for_image, wait_until
from volery_benchmarks.page.serving import PageProcess

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

_SIZE = {"width": 1440, "height": 810}
_PATIENCE_MS = 600_000
_FRAMES = 12
"""Frames drawn after the pause: details and camera motions finish."""
_PAUSED = 2
_JPEG_QUALITY = 85


@dataclass(frozen=True)
class Shot:
    """Describes one screenshot.

    `at_s` is the simulated time, `view` the fragment of the page's address, `layout` as the page
    stores it, `lines` the fields that are plotted.
    """

    name: str
    scenario: str
    at_s: float
    view: str
    layout: dict[str, Any] = field(default_factory=dict)
    lines: tuple[tuple[str, str, str], ...] = ()
    options: tuple[str, ...] = ()
    scheme: str = "light"


_ODOMETRY = "nav_msgs/msg/Odometry"
SHOTS = (
    Shot(
        "page_forest",
        "forest_survey",
        25.0,
        "view=chase&uav=uav2&quality=high",
        {"left": "vehicles", "right": "inspector"},
    ),
    Shot(
        "page_city",
        "city_flight",
        15.0,
        "view=chase&uav=uav1&quality=high",
        {"left": "", "right": "environment"},
        scheme="dark",
    ),
    Shot(
        "page_data",
        "forest_survey",
        30.0,
        "view=chase&uav=uav2&quality=high",
        {"left": "", "bottom": "plots"},
        tuple(
            (f"/uav{number}/odom", _ODOMETRY, f"twist.twist.linear.{axis}")
            for number, axis in ((1, "x"), (2, "x"), (3, "x"))
        ),
        scheme="dark",
    ),
    Shot(
        "page_cameras",
        "forest_cameras",
        12.0,
        "view=chase&uav=uav1&quality=high",
        {"left": "vehicles", "shown": {"map": True, "pictures": True}},
    ),
)


def main(folder: Path, names: list[str]) -> None:
    """Takes all screenshots, or those of the given names."""
    wanted = [shot for shot in SHOTS if not names or shot.name in names]
    folder.mkdir(parents=True, exist_ok=True)
    with open_browser() as browser:
        for shot in wanted:
            path = folder / f"{shot.name}.jpg"
            _take(browser, shot, path)
            print(path)


def _take(browser: Browser, shot: Shot, path: Path) -> None:
    with PageProcess(shot.scenario, "--seconds", "1e6", *shot.options) as server:
        context = browser.new_context(viewport=_SIZE, color_scheme=shot.scheme)  # type: ignore[arg-type]
        context.set_default_timeout(_PATIENCE_MS)
        context.add_init_script(_kept(shot))
        try:
            page = context.new_page()
            page.goto(f"{server.url}#{shot.view}")
            wait_for_image(page)
            _pause_at(server, shot.at_s)
            _settle(page)
            page.screenshot(path=path, type="jpeg", quality=_JPEG_QUALITY)
        finally:
            context.close()


def _kept(shot: Shot) -> str:
    """Returns a script that stores the layout and the plots in the browser."""
    lines = [{"topic": topic, "type": kind, "path": path} for topic, kind, path in shot.lines]
    kept = {"volery.layout": shot.layout}
    if lines:
        kept["volery.plots"] = {"plots": [{"id": 1, "lines": lines}], "windowS": 20}
    return "".join(
        f"localStorage.setItem({json.dumps(key)}, {json.dumps(json.dumps(value))});"
        for key, value in kept.items()
    )


def _pause_at(server: PageProcess, time_s: float) -> None:
    """Pauses the simulation at a simulated time."""
    with connect(server.rosbridge) as socket:
        socket.send(json.dumps({"op": "subscribe", "topic": "/volery/status", "queue_length": 1}))
        ends = time.monotonic() + _PATIENCE_MS / 1000
        while json.loads(socket.recv(timeout=60))["msg"]["stamp"]["sec"] < time_s:
            if time.monotonic() > ends:
                raise VoleryError(f"the simulation did not reach {time_s} s")
        call = {"op": "call_service", "service": "/set_simulation_state", "id": "pause"}
        socket.send(json.dumps({**call, "args": {"state": {"state": _PAUSED}}}))
        while json.loads(socket.recv(timeout=60)).get("id") != "pause":
            pass


def _settle(page: Page) -> None:
    seen = page.evaluate("window.volery.frames")
    drawn = f"window.volery.frames >= {seen + _FRAMES}"
    heard = "document.querySelector('.banner') === null"  # slow frames may look like a lost server
    wait_until(page, f"{drawn} && {heard}", _PATIENCE_MS / 1000.0)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", help=f"of {', '.join(shot.name for shot in SHOTS)}")
    parser.add_argument("--folder", type=Path, default=Path("docs/pictures"))
    chosen = parser.parse_args()
    main(chosen.folder, chosen.names)
