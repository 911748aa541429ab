"""Measures the bench `page`: each figure with its own server and page, one after the other."""

from __future__ import annotations

import logging
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from volery.core.errors import VoleryError
from volery_benchmarks.page import worlds
from volery_benchmarks.page.browser import open_browser
from volery_benchmarks.page.cost import clients_figures, real_time_factor, stall_figures
from volery_benchmarks.page.looking import (
    first_image_s,
    frame_work,
    heap_bytes,
    initial_script_mb,
    looking,
    shown_age_ms,
)
from volery_benchmarks.page.serving import PageProcess
from volery_benchmarks.registry import Measured

if TYPE_CHECKING:
    from playwright.sync_api import Browser

SOAK_S = 900.0
"""Time over which the memory of an open page is measured, s."""
_WARM_S = 30.0
"""Time after which one-time allocations of a page, such as buffers, are complete, s."""
_OPENINGS = 3
_AGE_S = 10.0
_LOG = logging.getLogger("volery_benchmarks.page")


def measure(soak_s: float = SOAK_S) -> Measured:
    """Returns the figures of the bench `page`; parts that fail are listed as failures."""
    figures: dict[str, float] = {}
    failures: dict[str, str] = {}
    with open_browser("--enable-precise-memory-info") as browser:
        parts: dict[str, Callable[[], dict[str, float]]] = {
            "opening": lambda: _opening(browser),
            "age": lambda: _age(browser),
            "50 UAVs": lambda: _crowd(browser, 50),
            "256 UAVs": lambda: _crowd(browser, 256),
            "1,000 UAVs": lambda: _crowd(browser, 1000) | _large_crowd(browser, 1000),
            "forest": lambda: _forest(browser),
            "other clients": lambda: _others(browser),
            "memory": lambda: _memory(browser, soak_s),
        }
        for name, part in parts.items():
            _LOG.info("page: %s", name)
            try:
                figures.update(part())
            except (VoleryError, OSError, _timeout()) as error:
                failures[name] = str(error).partition("\n")[0]
        chromium = browser.version
    return Measured(figures, failures, {"chromium": chromium, "playwright": version("playwright")})


def _timeout() -> type[Exception]:
    from playwright.sync_api import Error

    return Error


@contextmanager
def _serving(toml: str) -> Iterator[PageProcess]:
    """Runs a server with the scenario of a text."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "scenario.toml"
        path.write_text(toml, encoding="utf-8")
        with PageProcess(str(path), "--recordings-dir", folder) as server:
            yield server


def _opening(browser: Browser) -> dict[str, float]:
    times = []
    with PageProcess("hover", "--seconds", "1e6") as server:
        for _ in range(_OPENINGS):
            with looking(browser, server.url) as page:
                times.append(first_image_s(page))
                script_mb = initial_script_mb(page)
    return {"bundle_initial_mb": script_mb, "first_picture_s": float(np.median(times))}


def _age(browser: Browser) -> dict[str, float]:
    with (
        _serving(worlds.crowd(10)) as server,
        looking(browser, server.url, 320, 180) as page,
    ):
        page.wait_for_timeout(1000 * _AGE_S)  # until the clocks are synchronized
        return {"age_p95_ms": shown_age_ms(page, _AGE_S)}


def _crowd(browser: Browser, uavs: int) -> dict[str, float]:
    with _serving(worlds.crowd(uavs)) as server, looking(browser, server.url) as page:
        work = frame_work(page)
    return {
        f"script_ms_{uavs}_uavs": work["script_ms"],
        f"update_ms_{uavs}_uavs": work["update_ms"],
    }


def _large_crowd(browser: Browser, uavs: int) -> dict[str, float]:
    """Returns the age of what is shown of a crowd, and the real-time factor meanwhile."""
    with _serving(worlds.crowd(uavs)) as server, looking(browser, server.url, 320, 180) as page:
        page.wait_for_timeout(1000 * _AGE_S)  # until the clocks are synchronized
        factor, _ = real_time_factor(server, _AGE_S)
        return {
            f"age_p95_ms_{uavs}_uavs": shown_age_ms(page, _AGE_S),
            f"real_time_factor_{uavs}_uavs": factor,
        }


def _forest(browser: Browser) -> dict[str, float]:
    with _serving(worlds.forest()) as server, looking(browser, server.url) as page:
        return {"draw_calls": frame_work(page)["draw_calls"]}


def _others(browser: Browser) -> dict[str, float]:
    topics = [f"/uav{number}/odom" for number in range(1, 11)]
    with (
        _serving(worlds.crowd(10)) as server,
        looking(browser, server.url, 320, 180) as page,
    ):
        figures = stall_figures(server, topics)
        figures |= clients_figures(server, topics)
        page.evaluate("window.volery.frames")  # the page still responds
    return figures


def _memory(browser: Browser, soak_s: float) -> dict[str, float]:
    with (
        _serving(worlds.crowd(10)) as server,
        looking(browser, server.url, 320, 180) as page,
    ):
        page.wait_for_timeout(1000 * min(_WARM_S, soak_s))
        before, ends = heap_bytes(page), time.monotonic() + soak_s
        while (left := ends - time.monotonic()) > 0:
            page.wait_for_timeout(1000 * min(left, 10.0))
        name = "heap_growth_15_min" if soak_s >= SOAK_S else f"heap_growth_{soak_s:g}_s"
        return {name: heap_bytes(page) / before - 1.0, "heap_mb": before / 1e6}
