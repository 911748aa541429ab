import json
import os
import re
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from typer.testing import CliRunner

from volery.cli.app import app
from volery.world.mesh import Mesh
from volery_benchmarks import registry
from volery_benchmarks.document import render
from volery_benchmarks.peers import rays
from volery_benchmarks.peers.catalogue import PEERS, Contest, HoverContest, Peer, RayContest
from volery_benchmarks.peers.contests import measure_peers
from volery_benchmarks.peers.environments import environment
from volery_benchmarks.peers.failure import PeerError, last_line
from volery_benchmarks.peers.hover import check_hover, hover_task
from volery_benchmarks.peers.peer_process import PeerProcess
from volery_benchmarks.peers.task import Task
from volery_benchmarks.registry import Measured, Result

HERE = Path(sys.executable)
HOVER = HoverContest(drones=4, worlds=1, steps=50)
GOOD = """
import time
def prepare(request):
    print("a greeting on standard output")
    def advance():
        time.sleep(0.002)
    return advance, lambda: {"position_error_m": 0.01, "request": request}
"""
FALLEN = "def prepare(request): return lambda: None, lambda: {'position_error_m': 9.5}"
NOT_A_NUMBER = "def prepare(request): return lambda: None, lambda: {'position_error_m': 'far'}"
ONE_CORE = """
import os
def prepare(request):
    return lambda: None, lambda: {"position_error_m": len(os.sched_getaffinity(0)) - 1}
"""
BROKEN = "def prepare(request): raise ImportError('no such engine')"
BROKEN_LATER = """
def prepare(request):
    def advance():
        raise RuntimeError("out of batteries")
    return advance, dict
"""
SLOW = """
import time
def prepare(request):
    return lambda: time.sleep(600), dict
"""


def peer(*contests: Contest, requirements: tuple[str, ...] = ("numpy==2",)) -> Peer:
    return Peer("fake", requirements, "fake.py", contests)


def small_task(contest: Contest, _folder: Path) -> Task:
    """Ours takes no time, and the peer's facts are judged as those of a hover."""

    def check(facts: object) -> dict[str, float]:
        if facts is not None:
            check_hover(facts)  # type: ignore[arg-type]
        return {}

    return Task(lambda: None, 1000, 200, {}, check, lambda: None, 2000)


def measured_with(script: str, folder: Path) -> Measured:
    (folder / "fake.py").write_text(script)
    return measure_peers(
        [peer(HOVER)],
        environment=lambda _: HERE,
        prepare=small_task,
        scripts=folder,
        seconds=0.0,
    )


# ------------------------------------------------------------------------------- environments


@pytest.mark.slow  # pip makes an environment
def test_folder_that_does_not_exist_cannot_be_installed(tmp_path: Path) -> None:
    missing = tmp_path / "no_such_package"
    with pytest.raises(PeerError, match=r"cannot be installed: .*no_such_package"):
        environment(peer(requirements=(str(missing),)), tmp_path / "peers")
    left = [path for path in (tmp_path / "peers").iterdir() if path.is_dir()]
    assert left == []


@pytest.mark.slow  # pip makes an environment
def test_environment_is_made_once_and_used_again(tmp_path: Path) -> None:
    nothing = peer(requirements=("pip",))  # in every environment from the start
    python = environment(nothing, tmp_path)
    response = subprocess.run(
        [python, "-I", "-c", "import sys; print(sys.prefix); import pip"],
        capture_output=True,
        text=True,
        check=True,
    )
    assert Path(response.stdout.strip()) == python.parent.parent
    (python.parent.parent / "kept").touch()
    assert environment(nothing, tmp_path, timeout_s=1e-3) == python
    assert (python.parent.parent / "kept").exists()
    with pytest.raises(PeerError, match=r"longer than 0\.001 s"):
        environment(peer(requirements=("pip", "pip>1")), tmp_path, timeout_s=1e-3)


def test_unwritable_cache_is_a_failure_of_the_peer(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(PeerError, match="cannot be installed"):
        environment(peer(), tmp_path / "file" / "peers")


# ------------------------------------------------------------------------------- peer processes


def test_requests_and_responses(tmp_path: Path) -> None:
    script = tmp_path / "good.py"
    script.write_text(GOOD)
    request = {"packages": ["numpy"], "places": [[0.0, 1.0, 2.0]]}
    with PeerProcess(HERE, script, request, tmp_path) as process:
        assert process.versions() == {"numpy": np.__version__}
        begun_s = time.perf_counter()
        round_s = process.round()
        assert 0.002 <= round_s <= time.perf_counter() - begun_s
        assert process.facts() == {"position_error_m": 0.01, "request": request}


@pytest.mark.parametrize(
    ("script", "timeout_s", "message"),
    [
        (BROKEN, 60.0, "ended: ImportError: no such engine"),
        (BROKEN_LATER, 60.0, "ended: RuntimeError: out of batteries"),
        (SLOW, 0.5, "no response to 'round' within 0.5 s"),
    ],
)
def test_failures_of_a_script_are_reported(
    tmp_path: Path, script: str, timeout_s: float, message: str
) -> None:
    file = tmp_path / "bad.py"
    file.write_text(script)
    request = {"packages": []}
    with PeerProcess(HERE, file, request, tmp_path, round_timeout_s=timeout_s) as process:

        def converse() -> None:
            process.versions()
            process.round()

        with pytest.raises(PeerError, match=re.escape(message)):
            converse()


def test_last_line() -> None:
    assert last_line("one\n  two \n\n") == "two"
    assert last_line("\n") == ""


# ----------------------------------------------------------------------------------- contests


def test_ours_and_the_peer_are_measured_beside_each_other(tmp_path: Path) -> None:
    measured = measured_with(GOOD, tmp_path)
    assert measured.failures == {}
    assert measured.versions == {"fake": f"numpy {np.__version__}"}
    figures = measured.figures
    theirs, ours = figures["fake_4_drones_steps_per_s"], figures["fake_4_drones_ours_steps_per_s"]
    assert theirs < 200 / 0.002
    assert figures["fake_4_drones_ratio"] == pytest.approx(ours / theirs)
    assert figures["fake_4_drones_real_time_factor"] == pytest.approx(theirs / 2000)
    assert figures["fake_4_drones_ours_real_time_factor"] == pytest.approx(ours / 2000)


def test_both_keep_to_one_core_meanwhile(tmp_path: Path) -> None:
    cores = os.sched_getaffinity(0)
    assert measured_with(ONE_CORE, tmp_path).failures == {}
    assert os.sched_getaffinity(0) == cores


@pytest.mark.parametrize(
    ("script", "reason"),
    [
        (BROKEN, "ended: ImportError: no such engine"),
        (FALLEN, "a drone is 9.5 m from its position; up to 0.5 m is hovering"),
        (NOT_A_NUMBER, "does not report position_error_m"),
    ],
)
def test_ours_is_measured_where_the_peer_fails(tmp_path: Path, script: str, reason: str) -> None:
    measured = measured_with(script, tmp_path)
    assert measured.failures == {"fake_4_drones": reason}
    assert measured.figures.keys() == {
        "fake_4_drones_ours_steps_per_s",
        "fake_4_drones_ours_real_time_factor",
    }


def test_failed_installation_is_reported_once_and_the_bench_goes_on(tmp_path: Path) -> None:
    def refuse(_: Peer) -> Path:
        raise PeerError("cannot be installed: no wheel")

    measured = measure_peers(
        [peer(HOVER, RayContest())],
        environment=refuse,
        prepare=small_task,
        scripts=tmp_path,
        seconds=0.0,
    )
    assert measured.failures == {"fake": "cannot be installed: no wheel"}
    assert {"fake_4_drones_ours_steps_per_s", "fake_forest_ours_rays_per_s"} <= set(
        measured.figures
    )


def test_ours_holds_its_positions(tmp_path: Path) -> None:
    task = hover_task(HOVER)
    task.ours()
    assert task.amount == 4 * 500
    assert task.simulated_per_s == 4 * 500
    assert task.request["rate_hz"] == 500
    assert len(task.request["places"]) == 4
    assert task.check({"position_error_m": 0.1}) == {}
    assert task.check(None) == {}
    with pytest.raises(PeerError, match="nan m from its position"):
        task.check({"position_error_m": float("nan")})


# --------------------------------------------------------------------------------------- rays


def test_agreement_counts_near_hits_and_common_misses() -> None:
    miss = np.inf
    ours = np.array([1.0, 2.0, 3.0, miss, miss, 4.0])
    theirs = np.array([1.009, 2.011, 3.0, miss, 5.0, miss])
    assert rays.agreement(ours, theirs) == pytest.approx(3 / 6)
    assert rays.agreement(ours, np.full(6, np.nan)) == 0.0


def test_rays_are_handed_over_with_their_meshes(tmp_path: Path) -> None:
    triangle = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)
    one = Mesh(triangle, np.array([[0, 1, 2]], np.uint32))
    two = Mesh(triangle + 5, np.array([[2, 1, 0], [0, 1, 2]], np.uint32))
    origins, directions = np.zeros((4, 3)), np.tile([0.0, 0.0, 1.0], (4, 1))
    rays.write_rays(tmp_path / "rays.npz", [one, two], origins, directions)
    data = np.load(tmp_path / "rays.npz")
    assert data["first_vertex"].tolist() == [0, 3, 6]
    assert data["first_triangle"].tolist() == [0, 1, 3]
    assert data["triangles"].tolist() == [[0, 1, 2], [5, 4, 3], [3, 4, 5]]
    np.testing.assert_array_equal(data["vertices"][3:], two.vertices)
    np.testing.assert_array_equal(data["directions"], directions)


def test_distances_that_are_missing_or_too_few_are_failures(tmp_path: Path) -> None:
    path = tmp_path / "distances.npy"
    with pytest.raises(PeerError, match="left no distances"):
        rays.read_distances(path, 2)
    np.save(path, np.array([1.0, np.inf]))
    assert rays.read_distances(path, 2).tolist() == [1.0, np.inf]
    with pytest.raises(PeerError, match=r"shape \(2,\), not \(3,\)"):
        rays.read_distances(path, 3)


def test_a_peer_that_sees_another_world_gets_no_figures(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(rays, "PIECE_M", 20.0)
    task = rays.ray_task(RayContest(uavs=1), tmp_path)
    task.ours()
    request = task.request
    assert task.amount == task.peer_amount == request["batch"] == 2162
    data = np.load(request["arrays"])
    corners = data["vertices"][data["triangles"]].astype(float)
    beams = zip(data["origins"], data["directions"], strict=True)
    naive = np.array([closest(corners, origin, direction) for origin, direction in beams])
    naive[naive > request["reach_m"]] = np.inf
    np.save(request["distances"], naive)
    assert task.check({})["agreement"] > 0.9995  # of 2162
    assert 50 < np.isfinite(naive).sum() < 2000
    np.save(request["distances"], naive + 0.02)
    with pytest.raises(PeerError, match=r"only \d.*within 1 cm of ours; 99% are needed"):
        task.check({})
    assert task.check(None) == {}
    task.close()


def closest(corners: np.ndarray, origin: np.ndarray, direction: np.ndarray) -> float:
    """Moeller and Trumbore's test of one ray with all triangles."""
    a, b, c = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    p = np.cross(direction, c)
    det = (b * p).sum(1)
    with np.errstate(divide="ignore", invalid="ignore"):  # parallel to a triangle: no hit
        t = origin - a
        u = (t * p).sum(1) / det
        q = np.cross(t, b)
        v = (q @ direction) / det
        d = (c * q).sum(1) / det
        hit = (u >= 0) & (v >= 0) & (u + v <= 1) & (d > 0)
    return float(np.min(d[hit], initial=np.inf))


# ---------------------------------------------------------------------------- catalogue, page


def test_catalogue_is_pinned_and_its_scripts_keep_to_themselves() -> None:
    folder = Path(rays.__file__).parent
    for each in PEERS:
        assert all(re.fullmatch(r"[\w-]+==[\d.]+", name) for name in each.requirements)
        for script in (folder / each.script, folder / "host.py"):
            assert not re.search(r"^\s*(from|import) volery", script.read_text(), re.MULTILINE)


def test_page_shows_a_table_of_peers_and_what_failed() -> None:
    figures = {
        "open3d_forest_rays_per_s": 1e6,
        "open3d_forest_ours_rays_per_s": 4e6,
        "open3d_forest_ratio": 4.0,
        "open3d_forest_agreement": 0.9999,
        "pyflyt_100_drones_ours_steps_per_s": 5e6,
    }
    failures = {"pyflyt": "cannot be installed: no wheel"}
    result = Result("peers", {"cores": "2"}, figures, failures, {"open3d": "open3d 0.20.0"})
    assert Result.from_json(result.to_json()) == result
    text = render([result])
    assert (
        "| rays a second in a forest; 99.990% of distances agree | open3d "
        "| 1e+06 | 4e+06 | 4 | - | - |" in text
    )
    assert "100 drones in one world | pyflyt | - | 5e+06 | - | - | - |" in text
    assert "- open3d: open3d 0.20.0\n" in text
    assert "- not measured: pyflyt: cannot be installed: no wheel\n" in text


def test_command_prints_figures_and_failures(monkeypatch: pytest.MonkeyPatch) -> None:
    found = Measured({"fake_4_drones_ours_steps_per_s": 5.0}, {"fake": "no wheel"}, {"fake": "1"})
    module = SimpleNamespace(measure=lambda: found)
    monkeypatch.setattr(registry.importlib, "import_module", lambda name: module)
    result = CliRunner().invoke(app, ["bench", "peers", "--json"])
    assert result.exit_code == 0, result.stderr
    printed = json.loads(result.stdout)
    assert printed["bench"] == "peers"
    assert printed["figures"] == found.figures
    assert printed["failures"] == found.failures
    assert printed["versions"] == found.versions
    table = CliRunner().invoke(app, ["bench", "peers"]).stdout
    assert "not measured: fake: no wheel" in table
