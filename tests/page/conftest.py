"""A server and a browser for each module of page tests, and a page for each test."""

import importlib.util

import pytest

MISSING = [name for name in ("playwright", "roslibpy") if importlib.util.find_spec(name) is None]
if not MISSING:
    from page_browsing import Browsing
    from page_serving import Served
    from truth import set_speed

    from volery_benchmarks.page.browser import browser_path, open_browser

COMPOSED_PLAINLY = ("--disable-gpu-compositing", "--disable-gpu-rasterization")
"""WebGL stays as it is; the page around it is put together without software's OpenGL, which takes
seven times the processor's time of a frame."""

collect_ignore_glob = ["test_page_*.py"] if MISSING else []


@pytest.fixture(scope="session")
def chromium():
    """The browser; without one these tests are skipped."""
    from volery.server.page import STATIC

    if browser_path() is None:
        pytest.skip("there is no Chromium: apt-get install chromium")
    if not (STATIC / "index.html").is_file():
        pytest.skip("the page is not built: run `make web`")
    with open_browser(*COMPOSED_PLAINLY) as opened:
        yield opened


@pytest.fixture(scope="module")
def scenario(request):
    """What is flown; a module names another one as `SCENARIO`."""
    return getattr(request.module, "SCENARIO", "hover")


@pytest.fixture(scope="session")
def hover(chromium):
    """A running `volery serve hover` for all modules that need no server of their own."""
    with Served("hover") as server:
        yield server


@pytest.fixture(scope="module")
def served(request, scenario, chromium):
    """A running `volery serve`, in real time; `hover` is reset for each module."""
    if scenario == "hover":
        server = request.getfixturevalue("hover")
        server.call("/reset_simulation", "simulation_interfaces/srv/ResetSimulation")
        set_speed(server, 1.0)
        yield server
    else:
        with Served(scenario) as server:
            yield server


@pytest.fixture
def browsing(chromium):
    """Opens pages; a page that complains on its console fails the test."""
    pages = Browsing(chromium)
    yield pages
    pages.close()
    assert pages.unexpected() == []


@pytest.fixture(scope="module")
def module_browsing(chromium):
    """Pages that stay open for all tests of a module; tests take them by `shared`."""
    pages = Browsing(chromium)
    yield pages
    pages.close()


@pytest.fixture
def shared(module_browsing):
    """A module's own pages: opening one costs seconds, and these tests do not need a fresh one."""
    yield module_browsing
    problems = module_browsing.unexpected()
    module_browsing.tidy()
    assert problems == []


@pytest.fixture
def page(browsing, served):
    """The page of `served`, in a small window."""
    return browsing.open(served.url)
