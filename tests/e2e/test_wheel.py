"""The wheel, built and installed in a clean environment, holds its data and flies."""

import subprocess
import sys
import tarfile
import venv
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGE = "src/volery/server/static/index.html"
FLY = """
import volery, pathlib
assert "site-packages" in volery.__file__, volery.__file__
with volery.Simulation(volery.load_scenario("longleaf")) as simulation:
    simulation.run(1.0)
    print(len(simulation.world.forest), simulation.time_s)
"""


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_page_is_in_what_is_published(tmp_path):
    if not (ROOT / PAGE).is_file():
        pytest.skip("the page is not built: run `make web`")
    subprocess.run(
        [sys.executable, "-m", "build", "--outdir", str(tmp_path), str(ROOT)],
        check=True,
        capture_output=True,
    )  # the wheel from the source distribution, which therefore needs no Node.js
    (source,), (wheel,) = tmp_path.glob("*.tar.gz"), tmp_path.glob("*.whl")
    with tarfile.open(source) as archive:
        sources = archive.getnames()
    assert any(name.endswith(PAGE) for name in sources)
    assert not any("node_modules" in name for name in sources)
    names = zipfile.ZipFile(wheel).namelist()
    assert PAGE.removeprefix("src/") in names
    assert any(name.startswith("volery/server/static/assets/index-") for name in names)
    assert "volery_benchmarks/registry.py" in names


@pytest.mark.slow
@pytest.mark.timeout(1200)
def test_wheel_in_a_clean_environment(tmp_path):
    subprocess.run(
        [sys.executable, "-m", "build", "--wheel", "--outdir", str(tmp_path), str(ROOT)],
        check=True,
        capture_output=True,
    )
    (wheel,) = tmp_path.glob("*.whl")
    names = zipfile.ZipFile(wheel).namelist()
    for suffix in (
        "scenario/library/forest_survey.toml",
        "world/data/forests/bei_trees.csv",
        "world/data/city/helsinki_buildings.geojson",
        "vehicle/airframes/f450.toml",
        "sensors/models/utm_30lx.toml",
        "graph/definitions/std_srvs/srv/Trigger.srv",
        "py.typed",
    ):
        assert any(name.endswith(suffix) for name in names), suffix
    assert not any("tests" in Path(name).parts or name.endswith(".pyc") for name in names)
    venv.create(tmp_path / "env", with_pip=True)
    python = tmp_path / "env" / "bin" / "python"
    pip = [str(python), "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
    subprocess.run([*pip, str(wheel)], check=True)
    flown = subprocess.run(
        [str(python), "-c", FLY], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert flown.stdout.startswith("584 ")
    command = [str(python.parent / "volery"), "list"]
    listed = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True)
    assert "forest_survey" in listed.stdout
