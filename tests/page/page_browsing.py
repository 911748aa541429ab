"""Pages of a test, which must not log errors, and their screenshots."""

from __future__ import annotations

import re
from pathlib import Path

SCREENSHOTS = Path(__file__).parents[2] / "runs" / "page"
"""Screenshots of the tests, to be looked at."""
HANG_S = 600.0
"""No measure of anything: a machine with other work may take so long over a click."""
SMALL = {"width": 640, "height": 360}
COARSE = "Object.defineProperty(window, 'devicePixelRatio', { get: () => 0.25 })"
"""The scene gets one pixel for sixteen of the page: software draws slowly."""
SPARSE = """
(() => {
  const ask = window.requestAnimationFrame.bind(window);
  const forget = window.cancelAnimationFrame.bind(window);
  const drawn = new WeakMap(), waits = new Map();
  let requests = 0;
  window.requestAnimationFrame = (draw) => {
    const id = ++requests;
    const begin = () => {
      const frame = ask((now) => {
        waits.delete(id);
        drawn.set(draw, performance.now());
        draw(now);
      });
      waits.set(id, () => forget(frame));
    };
    const restMs = (drawn.get(draw) ?? -Infinity) + 90 - performance.now();
    if (restMs > 0) {
      const timer = setTimeout(begin, restMs);
      waits.set(id, () => clearTimeout(timer));
    } else begin();
    return id;
  };
  window.cancelAnimationFrame = (id) => {
    waits.get(id)?.();
    waits.delete(id);
  };
})()
"""
"""What is drawn again and again, such as the scene, is drawn at most eleven times a second, so that
pages leave time to one another. Steps of its movements are as long as that at most."""
HARMLESS = (
    r"GPU stall due to ReadPixels",
    r"GroupMarkerNotSet",
)
"""What software rendering says of itself."""


class Browsing:
    """Pages, each in a context of its own, and what they complained of."""

    def __init__(self, chromium):
        self._chromium = chromium
        self._contexts = []
        self.problems = []
        self.expected = []
        """Patterns of console errors that belong to the test."""

    def open(self, url, *, viewport=None, init_script=None, **context):
        """Open a page and wait until it stands; `init_script` runs in it before its own scripts.

        Tests that name no quality look at no pixels: the scene is drawn as cheaply as can be.
        """
        opened = self._chromium.new_context(viewport=viewport or SMALL, **context)
        opened.set_default_timeout(1000 * HANG_S)
        self._contexts.append(opened)
        opened.add_init_script(SPARSE)
        if "quality=" not in url:
            url = with_fragment(url, "quality=minimal")
            opened.add_init_script(COARSE)
        if init_script is not None:
            opened.add_init_script(init_script)
        page = opened.new_page()
        page.on("console", self._on_console)
        page.on("pageerror", lambda error: self.problems.append(f"uncaught: {error}"))
        page.goto(url)
        page.locator(".page").wait_for()
        return page

    def _on_console(self, message):
        if message.type == "error":
            self.problems.append(f"{message.text} ({message.location.get('url', '')})")

    def unexpected(self):
        allowed = re.compile("|".join([*HARMLESS, *self.expected]))
        return [problem for problem in self.problems if not allowed.search(problem)]

    def tidy(self):
        """Close what floats over the pages, so that the next test finds them as this one did."""
        for context in self._contexts:
            for page in context.pages:
                page.keyboard.press("Escape")
                page.keyboard.press("Escape")
        self.problems.clear()
        self.expected.clear()

    def close(self):
        for context in self._contexts:
            context.close()


def with_fragment(url, parameter):
    """The address with one more parameter behind its #."""
    return f"{url}{'&' if '#' in url else '#'}{parameter}"


def save_screenshot(page, name):
    """Screenshot under runs/page/; returns its path."""
    SCREENSHOTS.mkdir(parents=True, exist_ok=True)
    path = SCREENSHOTS / f"{name}.png"
    page.screenshot(path=path)
    return path
