"""Pages of a test, which must not complain, and their pictures."""

from __future__ import annotations

import re
from pathlib import Path

PICTURES = Path(__file__).parents[2] / "runs" / "page"
"""Screenshots of the tests, to be looked at."""
SMALL = {"width": 640, "height": 360}
HARMLESS = (
    r"GPU stall due to ReadPixels",
    r"GroupMarkerNotSet",
)
"""What software rendering says of itself."""


class Browsing:
    """Pages of one test, each in a context of its own, and what they complained of."""

    def __init__(self, chromium):
        self._chromium = chromium
        self._contexts = []
        self.complaints = []
        self.expected = []
        """Patterns of complaints that belong to the test."""

    def open(self, url, *, viewport=None, init_script=None, **context):
        """Open a page and wait until it stands; `init_script` runs in it before its own scripts."""
        opened = self._chromium.new_context(viewport=viewport or SMALL, **context)
        opened.set_default_timeout(60_000)
        self._contexts.append(opened)
        if init_script is not None:
            opened.add_init_script(init_script)
        page = opened.new_page()
        page.on("console", self._hear)
        page.on("pageerror", lambda error: self.complaints.append(f"uncaught: {error}"))
        page.goto(url)
        page.locator(".page").wait_for()
        return page

    def _hear(self, message):
        if message.type == "error":
            self.complaints.append(f"{message.text} ({message.location.get('url', '')})")

    def unexpected(self):
        allowed = re.compile("|".join([*HARMLESS, *self.expected]))
        return [complaint for complaint in self.complaints if not allowed.search(complaint)]

    def close(self):
        for context in self._contexts:
            context.close()


def keep_picture(page, name):
    """Screenshot under runs/page/; returns its path."""
    PICTURES.mkdir(parents=True, exist_ok=True)
    path = PICTURES / f"{name}.png"
    page.screenshot(path=path)
    return path
