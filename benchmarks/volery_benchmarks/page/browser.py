"""Starts headless Chromium that draws WebGL in software."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from volery.core.errors import VoleryError
from volery.core.extras import missing_package

if TYPE_CHECKING:
    from playwright.sync_api import Browser

FLAGS = (
    "--headless",
    "--no-sandbox",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
)
_NAMES = ("chromium", "chromium-browser", "google-chrome")


def browser_path() -> str | None:
    """Returns the path of a Chromium: VOLERY_BROWSER, or one on the search path."""
    return os.environ.get("VOLERY_BROWSER") or next(filter(None, map(shutil.which, _NAMES)), None)


@contextmanager
def open_browser(*flags: str) -> Iterator[Browser]:
    """Opens one browser, for many pages. Raises `VoleryError` if there is none.

    `flags` are Chromium's, besides `FLAGS`.
    """
    try:
        from playwright.sync_api import sync_playwright
    except ModuleNotFoundError:
        raise VoleryError(missing_package("bench page", "playwright", "bench")) from None
    path = browser_path()
    if path is None:
        raise VoleryError("this needs a Chromium: apt-get install chromium, or VOLERY_BROWSER")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=[*FLAGS, *flags])
        try:
            yield browser
        finally:
            browser.close()
