"""The packages: source distribution, wheel, an empty environment, a flight with the page."""

import json
import os
import re
import signal
import subprocess
import sys
import tarfile
import threading
import time
import urllib.request
import venv
import zipfile
from pathlib import Path
from types import SimpleNamespace

import pytest
from child_process import start_child

ROOT = Path(__file__).parents[2]
PAGE = "src/volery/server/static/index.html"
DATA = (
    "scenario/library/forest_survey.toml",
    "world/data/forests/bei_trees.csv",
    "world/data/city/helsinki_buildings.geojson",
    "vehicle/airframes/f450.toml",
    "sensors/models/utm_30lx.toml",
    "graph/definitions/std_srvs/srv/Trigger.srv",
    "py.typed",
)
FLY = """
import volery, pathlib
assert "site-packages" in volery.__file__, volery.__file__
with volery.Simulation(volery.load_scenario("longleaf")) as simulation:
    simulation.run(1.0)
    print(len(simulation.world.forest), simulation.time_s)
"""
FIRST_STEP_TIMEOUT_S = 900.0
"""Includes the compilation of all kernels into an empty cache on a busy machine."""

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def packages(tmp_path_factory):
    """The source distribution, and the wheel that is built from it without Node.js and git."""
    if not (ROOT / PAGE).is_file():
        pytest.skip("the page is not built: run `make web`")
    folder = tmp_path_factory.mktemp("dist")
    build = [sys.executable, "-m", "build", "--outdir", str(folder)]
    subprocess.run([*build, "--sdist", str(ROOT)], check=True, capture_output=True)
    (source,) = folder.glob("*.tar.gz")
    with tarfile.open(source) as archive:
        archive.extractall(folder, filter="data")
    unpacked = folder / source.name.removesuffix(".tar.gz")
    subprocess.run(
        [*build, "--wheel", str(unpacked)],
        check=True,
        capture_output=True,
        env={**os.environ, "PATH": ""},
    )
    (wheel,) = folder.glob("*.whl")
    return SimpleNamespace(source=source, wheel=wheel)


@pytest.fixture(scope="module")
def environment(packages, tmp_path_factory):
    """The `bin` folder of an environment that contains the wheel and its dependencies only."""
    folder = tmp_path_factory.mktemp("empty") / "env"
    venv.create(folder)
    pip = [sys.executable, "-m", "pip", "--python", str(folder / "bin" / "python"), "--quiet"]
    pip += ["--disable-pip-version-check", "install"]
    subprocess.run([*pip, str(packages.wheel)], check=True)
    return folder / "bin"


def test_source_distribution_holds_page_and_commit(packages):
    with tarfile.open(packages.source) as archive:
        names = archive.getnames()
    assert any(name.endswith(PAGE) for name in names)
    assert any(name.endswith("src/volery/build_commit.json") for name in names)
    assert not any("node_modules" in name for name in names)


def test_wheel_holds_page_data_and_commit_but_no_tests(packages):
    with zipfile.ZipFile(packages.wheel) as archive:
        names = archive.namelist()
        commit = json.loads(archive.read("volery/build_commit.json"))["id"]
    assert commit == git("rev-parse", "HEAD")
    assert PAGE.removeprefix("src/") in names
    assert any(name.startswith("volery/server/static/assets/index-") for name in names)
    assert "volery_benchmarks/registry.py" in names
    assert {"volery/examples/01_fly_one_uav.py", "volery/examples/studies/gusts.toml"} <= {*names}
    for suffix in DATA:
        assert any(name.endswith(suffix) for name in names), suffix
    assert not any("tests" in Path(name).parts or name.endswith(".pyc") for name in names)


def test_wheel_flies_in_an_empty_environment(environment, tmp_path):
    flown = run(environment / "python", "-c", FLY, cwd=tmp_path)
    assert flown.startswith("584 ")
    assert "forest_survey" in run(environment / "volery", "list", cwd=tmp_path)


def test_wheel_names_its_commit(environment, tmp_path):
    build = json.loads(run(environment / "volery", "--version", "--json", cwd=tmp_path))
    assert build["commit"]["id"] == git("rev-parse", "HEAD")
    assert build["has_page"]


def test_wheel_flies_with_its_page(environment, tmp_path):
    command = [str(environment / "volery"), "run", "hover", "--page=127.0.0.1:0"]
    with start_child(command, cwd=tmp_path, stderr=subprocess.PIPE, text=True) as process:
        killer = threading.Timer(2 * FIRST_STEP_TIMEOUT_S, process.kill)
        killer.start()
        try:
            url = address_of(process)
            page = get(url)
            assert "<title>Volery" in page
            script = re.search(r"assets/index-[\w-]+\.js", page)
            assert len(get(url + script[0])) > 100_000
            wait_until_flying(url)
            process.send_signal(signal.SIGINT)
            assert process.wait(60) == 130
        finally:
            killer.cancel()
            process.kill()


@pytest.mark.parametrize(
    ("extra", "words"),
    [
        ("autonomy", "run forest_search --seconds 1"),
        ("identify", "identify f450 --out model.toml"),
        ("mavlink", "run hover --seconds 1 --bridge mavlink"),
        ("ros2", "run hover --seconds 1 --bridge ros2"),
        ("bench", "bench page"),
    ],
)
def test_wheel_names_the_command_for_a_missing_extra(environment, tmp_path, extra, words):
    command = [str(environment / "volery"), *words.split()]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert f'pip install "volery[{extra}]"' in done.stderr
    assert not any(tmp_path.iterdir())


def address_of(process):
    for line in process.stderr:
        if found := re.search(r"http://\S+/", line):
            return found[0]
    raise AssertionError("the run ended without a page")


def wait_until_flying(url):
    end = time.monotonic() + FIRST_STEP_TIMEOUT_S
    while (status := json.loads(get(url + "api/status")))["state"] == "building":
        assert time.monotonic() < end, status
        time.sleep(0.2)
    assert (status["state"], status["scenario"]) == ("flying", "hover"), status


def get(url):
    with urllib.request.urlopen(url, timeout=60) as response:
        return response.read().decode()


def run(*words, cwd):
    command = [str(word) for word in words]
    done = subprocess.run(command, cwd=cwd, capture_output=True, text=True, check=True)
    return done.stdout


def git(*words):
    command = ["git", "-C", str(ROOT), *words]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip()
