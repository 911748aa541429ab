"""Studies on a Ray cluster: the same table, lost workers, addresses without a cluster."""

import os
import signal
import socket
import subprocess
import sys
import time

import pytest
from studies import study_file

from volery.cluster import StudyError, run_study
from volery.cluster.ray_worker import _check_size as check_size

pytest.importorskip("pyarrow")
pytest.importorskip("scipy")

MINE = """
import os, signal, time

def height_m(flight, log):
    if flight.seed == 2:
        os.kill(os.getpid(), signal.SIGKILL)
    if flight.seed == 3:
        os.kill(os.getpid(), signal.SIGSTOP)
    if flight.seed == 4:
        time.sleep(600.0)
    assert log.stat().st_size > 1000
    return float(flight.position_map[0, -1, 2])
"""


@pytest.fixture(scope="module")
def sweep(tmp_path_factory):
    """Starts a cluster of this machine on loopback, with a token, as docs/sweeps.md does.

    Returns a function that flies a study there and returns its table.
    """
    pytest.importorskip("ray")
    folder = tmp_path_factory.mktemp("ray")
    token = folder / "token"
    token.write_text("0123456789abcdef0123456789abcdef")
    variables = {
        **os.environ,
        "RAY_AUTH_MODE": "token",
        "RAY_AUTH_TOKEN_PATH": str(token),
    }
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    words = [
        *("start", "--head", "--block", "--node-ip-address=127.0.0.1", f"--port={port}"),
        *("--num-cpus=2", "--include-dashboard=false", "--disable-usage-stats"),
        f"--temp-dir={folder}",
    ]

    def fly(study, out, *words):
        command = [sys.executable, "-m", "volery", "sweep", str(study), "--out", str(out)]
        command += ["--ray", f"127.0.0.1:{port}", *words]
        done = subprocess.run(command, env=variables, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
        return run_study(study, out, workers=0, trust="--trust" in words)  # all are there

    with (
        open(folder / "head.log", "wb") as log,
        subprocess.Popen(
            [sys.executable, "-m", "ray.scripts.scripts", *words],
            env=variables,
            stdout=log,
            stderr=log,
            start_new_session=True,
        ) as head,
    ):
        try:
            until = time.monotonic() + 600.0
            while "Ray runtime started" not in (folder / "head.log").read_text():
                assert head.poll() is None
                assert time.monotonic() < until
                time.sleep(0.2)
            yield fly
        finally:
            os.killpg(head.pid, signal.SIGKILL)


@pytest.mark.slow
def test_a_cluster_gives_the_table_of_this_machine(sweep, tmp_path):
    (tmp_path / "mine.py").write_text(MINE.replace("flight.seed ==", "0 =="))
    text = "repetitions = 6\nlogs = 'all'\nmetrics = ['success', 'mine.py:height_m']\n"
    path = study_file(tmp_path, text)
    far = sweep(path, tmp_path / "far", "--trust")
    near = run_study(path, tmp_path / "near", workers=0, trust=True)
    assert far["status"] == ["done"] * 6
    assert far.repeatable == near.repeatable
    logs = sorted(each.name for each in (tmp_path / "near" / "logs").iterdir())
    assert len(logs) == 6
    assert sorted(each.name for each in (tmp_path / "far" / "logs").iterdir()) == logs


@pytest.mark.slow
def test_killed_silent_and_stuck_workers_cost_only_their_runs(sweep, tmp_path):
    (tmp_path / "mine.py").write_text(MINE)
    text = "repetitions = 5\nrun_timeout_s = 20.0\nmetrics = ['mine.py:height_m']\n"
    table = sweep(study_file(tmp_path, text), tmp_path / "out", "--trust")
    assert table["status"] == ["done", "failed", "failed", "failed", "done"]
    assert table["error"][1].startswith("its worker was lost: The actor died")
    assert table["error"][2].startswith("its worker was lost: no sign of life for")
    assert table["error"][3] == "its worker exceeded the timeout of 20 s"


@pytest.mark.slow
def test_code_of_an_untrusted_study_stays_here(sweep, tmp_path):
    (tmp_path / "numpy.py").write_text("raise SystemExit('the study runs its code')")
    path = study_file(tmp_path, "repetitions = 1\nmetrics = ['success']\n")
    assert sweep(path, tmp_path / "out")["status"] == ["done"]


@pytest.mark.parametrize(
    ("address", "reason"),
    [
        ("127.0.0.1", "give HOST:PORT"),
        ("somewhere:x", "give HOST:PORT"),
        ("127.0.0.1:1", r"no cluster there \(Connection refused\); start one"),
        ("127.0.0.1:99999", "no cluster there"),
    ],
)
def test_an_address_without_a_cluster_is_refused_at_once(tmp_path, address, reason):
    pytest.importorskip("ray")
    path = study_file(tmp_path, "repetitions = 1\nmetrics = ['success']\n")
    with pytest.raises(StudyError, match=rf"--ray {address}: {reason}"):
        run_study(path, tmp_path / "out", ray=address)


def test_a_large_folder_is_not_copied(tmp_path, monkeypatch):
    pytest.importorskip("ray")
    monkeypatch.setattr("volery.cluster.ray_worker._MAX_BYTES", 1000)
    path = study_file(tmp_path, "repetitions = 1\nmetrics = ['success']\n")
    (tmp_path / "runs").mkdir()
    for name in ("runs/large.bin", "large.mcap"):  # neither is copied
        (tmp_path / name).write_bytes(bytes(2000))
    with socket.create_server(("127.0.0.1", 0)) as server:
        address = f"127.0.0.1:{server.getsockname()[1]}"
        check_size(tmp_path)
        (tmp_path / "world.glb").write_bytes(bytes(2000))
        with pytest.raises(StudyError, match="put the study and its files into a folder of its"):
            run_study(path, tmp_path / "out", ray=address)


def test_without_ray_the_command_is_named(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "ray", None)
    path = study_file(tmp_path, "repetitions = 1\nmetrics = ['success']\n")
    with pytest.raises(StudyError, match=r'pip install "volery\[cluster\]"'):
        run_study(path, tmp_path / "out", ray="auto")
