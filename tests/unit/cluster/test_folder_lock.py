"""A results folder has one driver; the lock of a dead one is free."""

import json
import os
import signal
import subprocess
import sys

import pytest

from volery.cluster.errors import StudyError
from volery.cluster.folder_lock import FolderLock

HOLDER = """
import sys, time
from pathlib import Path
from volery.cluster.folder_lock import FolderLock
lock = FolderLock(Path(sys.argv[1]))
print("held", flush=True)
time.sleep(600)
"""


def test_a_second_driver_is_refused_until_the_first_releases(tmp_path):
    lock = FolderLock(tmp_path)
    words = f"another driver writes results here: process {os.getpid()} on .*since"
    with pytest.raises(StudyError, match=words):
        FolderLock(tmp_path)
    lock.release()
    FolderLock(tmp_path).release()
    assert not list(tmp_path.iterdir())


def test_the_lock_of_a_killed_driver_is_taken_over(tmp_path):
    command = [sys.executable, "-c", HOLDER, str(tmp_path)]
    with subprocess.Popen(command, stdout=subprocess.PIPE) as holder:
        assert holder.stdout.readline() == b"held\n"
        with pytest.raises(StudyError, match=f"process {holder.pid}"):
            FolderLock(tmp_path)
        holder.send_signal(signal.SIGKILL)
        holder.wait()
    assert (tmp_path / "lock").exists()
    FolderLock(tmp_path).release()


def test_parts_of_one_division_do_not_exclude_each_other(tmp_path):
    with FolderLock(tmp_path, (1, 4)), FolderLock(tmp_path, (2, 4)):
        for other in ((2, 4), (1, 3), None):
            with pytest.raises(StudyError, match="another driver"):
                FolderLock(tmp_path, other)
    with FolderLock(tmp_path), pytest.raises(StudyError, match="another driver"):
        FolderLock(tmp_path, (1, 4))
    assert not list(tmp_path.iterdir())


def test_a_lock_of_another_computer_names_the_file_to_delete(tmp_path):
    path = tmp_path / "lock"
    path.write_text(json.dumps({"pid": 7, "host": "elsewhere", "since": "today"}))
    with pytest.raises(StudyError, match=rf"process 7 on elsewhere.* delete {path}"):
        FolderLock(tmp_path)
    path.unlink()
    FolderLock(tmp_path).release()
