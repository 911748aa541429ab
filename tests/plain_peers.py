"""Plain DDS programs in processes of their own, which tests share: one starts in half a second."""

from __future__ import annotations

import atexit
import contextlib
import json
import os
import queue
import signal
import subprocess
import sys
import threading
from pathlib import Path

from ros2_bench import DOMAIN

_PROGRAM = Path(__file__).parent / "conformance" / "bridges" / "plain_ros2.py"
_TIMEOUT_S = 600.0
_START_S = 600.0
"""On a machine that is busy with other things."""
_SHORT_S, _LONG_S = 4.0, 120.0
_idle = {_SHORT_S: [], _LONG_S: []}


class PlainPeer:
    """One of them; `on_message` gets its report of each message."""

    def __init__(self, lease_s):
        self.lease_s = lease_s
        self.on_message = None
        self._ended = False
        self._done = queue.Queue()
        self._process = subprocess.Popen(
            [sys.executable, str(_PROGRAM), str(DOMAIN), str(lease_s)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()
        try:
            self._done.get(timeout=_START_S)
        except queue.Empty:
            self.kill()
            raise

    def _read(self):
        for line in self._process.stdout:
            if not line.endswith("\n"):
                break  # killed while it wrote
            report = json.loads(line)
            if "topic" not in report:
                self._done.put(report.get("done"))
            elif self.on_message is not None:
                self.on_message(report)

    def do(self, op, **fields):
        """Run an operation; its result."""
        self._process.stdin.write(json.dumps({"op": op, **fields}) + "\n")
        self._process.stdin.flush()
        return self._done.get(timeout=_TIMEOUT_S)

    def stop(self):
        """Have it stand still."""
        os.kill(self._process.pid, signal.SIGSTOP)

    def go_on(self):
        """Have it go on."""
        os.kill(self._process.pid, signal.SIGCONT)

    def give_back(self):
        """Let others have it, if it lives."""
        self.on_message = None
        if self._ended or self in _idle[self.lease_s]:
            return
        self.go_on()
        try:
            self.do("leave")
        except (queue.Empty, OSError):
            self.kill()
            raise
        _idle[self.lease_s].append(self)

    def kill(self):
        """Kill the process."""
        self._ended = True
        self._process.kill()
        self._process.wait()
        self._reader.join()
        with contextlib.suppress(BrokenPipeError):  # of a command that it never read
            self._process.stdin.close()
        self._process.stdout.close()


def take_peer(on_message=None, *, patient=False):
    """A peer that takes part in nothing yet.

    patient: others take it for gone after two minutes of silence, in place of four seconds.
    """
    idle = _idle[_LONG_S if patient else _SHORT_S]
    peer = idle.pop() if idle else PlainPeer(_LONG_S if patient else _SHORT_S)
    peer.on_message = on_message
    return peer


@atexit.register
def end_idle_peers():
    """Even idle ones cost what DDS does."""
    for peers in _idle.values():
        while peers:
            peers.pop().kill()
