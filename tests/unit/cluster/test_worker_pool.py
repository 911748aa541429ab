"""Worker processes: other versions, killed workers, timeouts, killed drivers."""

import os
import subprocess
import sys
import time

import pytest
from studies import TINY, study_file

from volery.cluster import StudyError, load_study, run_study
from volery.cluster.batches import Preparation, StudyJob
from volery.cluster.pool_worker import PoolWorker
from volery.cluster.process_worker import ProcessWorker
from volery.cluster.runs import versions
from volery.cluster.worker_pool import WorkerPool

pytest.importorskip("pyarrow")
pytest.importorskip("scipy")


def pool_of(job, folder):
    return WorkerPool(job, 1, lambda k, replies: ProcessWorker(k, folder / "log", replies))


def test_a_worker_with_another_version_is_refused(tmp_path, monkeypatch):
    loaded = load_study(TINY)
    mine = {**versions(), "numpy": "1.0.0"}
    monkeypatch.setattr("volery.cluster.worker_pool.versions", lambda: mine)
    job = StudyJob(loaded.study, "study", tmp_path, False, loaded.points[0], tmp_path)
    pool = pool_of(job, tmp_path)
    try:
        with pytest.raises(
            StudyError, match=r"worker 1 has numpy \S+ instead of 1\.0\.0: install the"
        ):
            pool.prepare()
    finally:
        pool.close()


def test_a_worker_that_cannot_start_is_named(tmp_path, monkeypatch):
    loaded = load_study(TINY)
    monkeypatch.setattr(sys, "executable", "/no/python")
    job = StudyJob(loaded.study, "study", tmp_path, False, loaded.points[0], tmp_path)
    with pytest.raises(StudyError, match="a worker cannot start: No such file"):
        pool_of(job, tmp_path).prepare()


class StandIn(PoolWorker):
    """A worker that answers at once; its number decides whether it ends when the job comes."""

    def __init__(self, number, replies, lost):
        super().__init__(f"worker {number}")
        self.is_lost, self.replies = number in lost, replies
        replies.put((self, Preparation(versions())))

    def send_job(self, job):
        self.replies.put((self, None if self.is_lost else Preparation(versions())))

    def end(self, reason):
        self.replies.put((self, None))

    def how_it_ended(self):
        return "was lost"

    def close(self):
        pass

    def _send_batch(self, batch):
        pass


def stand_ins(folder, lost):
    loaded = load_study(TINY)
    job = StudyJob(loaded.study, "study", folder, False, loaded.points[0], folder)
    return WorkerPool(job, 2, lambda number, replies: StandIn(number, replies, lost))


def test_a_worker_that_is_lost_before_its_first_run_is_replaced_while_another_flies(tmp_path):
    pool = stand_ins(tmp_path, lost={2, 3})
    pool.prepare()
    while len([one for one in pool.states() if one.state == "idle"]) < 2:
        assert pool.collect(0.1) == ()
    assert [one.name for one in pool.states()] == ["worker 1", "worker 4"]


def test_a_study_ends_where_no_worker_starts(tmp_path):
    with pytest.raises(StudyError, match="worker 1 was lost before its first run"):
        stand_ins(tmp_path, lost={1}).prepare()
    pool = stand_ins(tmp_path, lost={2, 3, 4, 5})
    pool.prepare()
    with pytest.raises(StudyError, match="worker 5 was lost before its first run"):
        pool.collect(60.0)


MINE = """
import os, signal, time

def height_m(flight):
    if flight.seed == 2:
        os.kill(os.getpid(), signal.SIGKILL)
    if flight.seed == 3:
        time.sleep(600.0)
    print("words of the user")  # must not disturb the pipe
    return float(flight.position_map[0, -1, 2])
"""


@pytest.mark.slow
def test_killed_and_stuck_workers_cost_only_their_runs(tmp_path):
    (tmp_path / "mine.py").write_text(MINE)
    text = "repetitions = 4\nrun_timeout_s = 10.0\nmetrics = ['mine.py:height_m']\n"
    path = study_file(tmp_path, text)
    table = run_study(path, tmp_path / "out", workers=1, trust=True)
    assert table["status"] == ["done", "failed", "failed", "done"]
    assert table["error"][1] == "its worker was killed by signal 9 (SIGKILL)"
    assert table["error"][2] == "its worker exceeded the timeout of 10 s"
    words = [log.read_text() for log in (tmp_path / "out" / "workers").iterdir()]
    assert any("words of the user" in each for each in words)


def running_children(pid):
    listed = subprocess.run(
        ["ps", "-o", "pid=", "--ppid", str(pid)], capture_output=True, text=True, check=False
    )
    return [int(word) for word in listed.stdout.split()]


def is_alive(pid):
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    with open(f"/proc/{pid}/stat") as file:
        return file.read().rpartition(")")[2].split()[0] != "Z"


WAITING = """
import os, time

def height_m(flight):
    while flight.seed >= 150 and not os.path.exists({opened!r}):
        time.sleep(0.01)
    return float(flight.position_map[0, -1, 2])
"""


@pytest.mark.slow
def test_a_killed_study_continues_to_the_table_of_an_uninterrupted_one(tmp_path):
    opened = tmp_path / "opened"
    (tmp_path / "waiting.py").write_text(WAITING.format(opened=str(opened)))
    text = "repetitions = 200\nvectorized = false\nmetrics = ['waiting.py:height_m']\n"
    path = study_file(tmp_path, text)
    out = tmp_path / "cut"
    command = [sys.executable, "-m", "volery", "sweep", str(path), "--workers", "1", "--trust"]
    with subprocess.Popen([*command, "--out", str(out)], stdout=subprocess.DEVNULL) as driver:
        try:
            until = time.monotonic() + 600.0
            while not list(out.glob("runs/*/*.json")):
                assert driver.poll() is None
                assert time.monotonic() < until
                time.sleep(0.01)
            workers = running_children(driver.pid)
        finally:
            driver.kill()
    assert workers
    until = time.monotonic() + 60.0
    while any(is_alive(pid) for pid in workers):  # they end with their driver
        assert time.monotonic() < until
        time.sleep(0.05)
    assert 0 < len(list(out.glob("runs/*/*.json"))) < 200
    opened.touch()
    resumed = run_study(path, out, workers=0, trust=True)
    whole = run_study(path, tmp_path / "whole", workers=0, trust=True)
    assert resumed.repeatable == whole.repeatable
    assert len(whole) == 200
