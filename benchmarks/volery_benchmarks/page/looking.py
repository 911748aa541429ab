"""Measures the page inside the browser."""

from __future__ import annotations

import gzip
import re
import time
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.resources import files
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING
from urllib.parse import urlsplit

import numpy as np

from volery.core.errors import VoleryError

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

_TIMEOUT_MS = 120_000
_FRAMES = 150
_GLANCE_MS = 20
_STATIC = Path(str(files("volery.server") / "static"))

_SCRIPT_OF_FRAMES = """async (frames) => {
  const found = [];
  for (let seen = window.volery.frames; found.length < frames; ) {
    await new Promise((resolve) => requestAnimationFrame(resolve));
    if (window.volery.frames === seen) continue;
    seen = window.volery.frames;
    found.push([window.volery.scriptMs, window.volery.updateMs, window.volery.drawCalls]);
  }
  return found;
}"""


@contextmanager
def looking(browser: Browser, url: str, width: int = 640, height: int = 360) -> Iterator[Page]:
    """Opens the page in its own window, panels closed; yields after the first frame."""
    context = browser.new_context(viewport={"width": width, "height": height})
    context.set_default_timeout(_TIMEOUT_MS)
    try:
        page = context.new_page()
        page.goto(url)
        wait_for_image(page)
        yield page
    finally:
        context.close()


def wait_for_image(page: Page) -> None:
    """Waits until the world has been drawn."""
    wait_until(page, "window.volery !== undefined && window.volery.firstRenderMs > 0")


def wait_until(page: Page, condition: str, timeout_s: float = _TIMEOUT_MS / 1000.0) -> None:
    """Waits until an expression holds in the page. Raises `VoleryError` after `timeout_s`.

    The page's content policy forbids Playwright's own waiting.
    """
    end = time.monotonic() + timeout_s
    while not page.evaluate(condition):
        if time.monotonic() > end:
            raise VoleryError(f"the page took more than {timeout_s:g} s until {condition}")
        page.wait_for_timeout(_GLANCE_MS)


def first_image_s(page: Page) -> float:
    """Returns the time from the request to the first frame with the world, s."""
    return float(page.evaluate("window.volery.firstRenderMs")) / 1000.0


def initial_script_mb(page: Page) -> float:
    """Returns the size of the scripts fetched until the first frame, compressed by gzip, MB."""
    fetched = page.evaluate(
        """() => performance.getEntriesByType("resource")
            .filter(({name, startTime}) => name.endsWith(".js")
                && startTime < window.volery.firstRenderMs)
            .map(({name}) => name)"""
    )
    names = {PurePosixPath(urlsplit(url).path).name for url in fetched}
    names |= _workers()
    if not names:
        raise VoleryError("the page fetched no script")
    scripts = (_STATIC / "assets" / name for name in names)
    return sum(len(gzip.compress(script.read_bytes(), 9)) for script in scripts) / 1e6


def frame_work(page: Page) -> dict[str, float]:
    """Returns the frame loop's load: medians of `script_ms`, `update_ms`; max of `draw_calls`."""
    found = np.array(page.evaluate(_SCRIPT_OF_FRAMES, _FRAMES))
    return {
        "script_ms": float(np.median(found[:, 0])),
        "update_ms": float(np.median(found[:, 1])),
        "draw_calls": float(found[:, 2].max()),
    }


def shown_age_ms(page: Page, seconds: float) -> float:
    """Returns the median of the page's own figure for the age of 95 % of its frames, ms."""
    meter = page.get_by_role("button", name=re.compile("^Health"))
    ages, ends = [], time.monotonic() + seconds
    while time.monotonic() < ends:
        page.wait_for_timeout(1000)
        found = re.search(r"(\d+) ms", meter.get_attribute("aria-label") or "")
        if found:
            ages.append(float(found[1]))
    if not ages:
        raise VoleryError("the page does not show the age of its data")
    return float(np.median(ages))


def heap_bytes(page: Page) -> float:
    """Returns the live memory of the page's script after garbage collection, bytes."""
    devtools = page.context.new_cdp_session(page)
    devtools.send("HeapProfiler.enable")
    devtools.send("HeapProfiler.collectGarbage")
    used = devtools.send("Runtime.getHeapUsage")["usedSize"]
    devtools.detach()
    return float(used)


def _workers() -> set[str]:
    """Returns the worker scripts, which the page's own list of resources lacks."""
    return {path.name for path in (_STATIC / "assets").glob("worker-*.js")}
