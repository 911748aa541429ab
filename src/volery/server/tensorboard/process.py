"""Starts TensorBoard on a free port of loopback, and ends it."""

from __future__ import annotations

import importlib.util
import os
import re
import subprocess
import sys
import threading
from collections import deque
from collections.abc import Sequence
from contextlib import suppress
from http.client import HTTPConnection, HTTPException
from pathlib import Path

from volery.core.errors import VoleryError
from volery.core.extras import missing_package

PREFIX = "/tensorboard"
_STARTING_S = 120.0
"""Timeout of the start; it takes seconds, on a busy machine longer."""
_ENDING_S = 5.0
_NUM_ERROR_LINES = 5
_URL = re.compile(rf"http://127\.0\.0\.1:(\d+){PREFIX}/")
_SECRETS = ("VOLERY_TOKEN", "VOLERY_VIEWER_TOKEN")


def tensorboard_command(folder: Path) -> list[str]:
    """Returns the command that serves the event files of a folder.

    Raises `VoleryError` if the folder or the package tensorboard is missing.
    """
    if not folder.is_dir():
        raise VoleryError(f"--tensorboard {folder}: no such folder; `volery train` makes training/")
    if importlib.util.find_spec("tensorboard") is None:
        raise VoleryError(missing_package("TensorBoard", "tensorboard", "train"))
    own = [sys.executable, "-P", "-m", "volery.server.tensorboard.child"]
    address = ["--host", "127.0.0.1", "--port", "0", "--path_prefix", PREFIX]
    return [*own, *address, "--load_fast", "false", "--logdir", str(folder.resolve())]


class TensorBoardProcess:
    """A TensorBoard process, from `start` to `stop`.

    command: prints `http://127.0.0.1:PORT/tensorboard/` when it listens there, and ends with its
    standard input.
    """

    def __init__(self, command: Sequence[str], starting_s: float = _STARTING_S) -> None:
        self._command = command
        self._starting_s = starting_s
        self._process: subprocess.Popen[str] | None = None
        self._reader = threading.Thread()
        self._lines: deque[str] = deque(maxlen=_NUM_ERROR_LINES)
        self._listening = threading.Event()
        self._port: int | None = None

    @property
    def port(self) -> int | None:
        """Its port of loopback; None: the process does not run."""
        process = self._process
        return self._port if process is not None and process.poll() is None else None

    def start(self) -> None:
        """Starts the process and waits until it answers.

        Raises `VoleryError` with its last output if it ends or does not answer in time.
        """
        self._process = subprocess.Popen(
            self._command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            errors="replace",
            env={name: value for name, value in os.environ.items() if name not in _SECRETS},
            start_new_session=True,  # Ctrl-C is for the server, which ends it
        )
        self._reader = threading.Thread(target=self._read, name="volery-tensorboard", daemon=True)
        self._reader.start()
        try:
            self._wait()
        except BaseException:
            self.stop()
            raise

    def stop(self) -> None:
        """Ends the process, by force if needed; further calls do nothing."""
        process, self._process = self._process, None
        if process is None:
            return
        process.terminate()
        try:
            process.wait(_ENDING_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
        self._reader.join(_ENDING_S)
        for stream in (process.stdin, process.stdout):
            if stream is not None:
                stream.close()

    def _wait(self) -> None:
        if not self._listening.wait(self._starting_s):
            raise VoleryError(self._problem(f"did not answer within {self._starting_s:g} s"))
        if self._port is None:
            raise VoleryError(self._problem("ended during its start"))
        connection = HTTPConnection("127.0.0.1", self._port, timeout=self._starting_s)
        try:
            connection.request("GET", f"{PREFIX}/data/plugins_listing")
            status = connection.getresponse().status
        except (OSError, HTTPException) as error:
            raise VoleryError(self._problem(f"does not answer ({error})")) from None
        finally:
            connection.close()
        if status != 200:
            raise VoleryError(self._problem(f"answers with HTTP status {status}"))

    def _problem(self, what: str) -> str:
        words = " / ".join(line.strip() for line in tuple(self._lines) if line.strip())
        return f"TensorBoard {what}; its last output: {words or 'none'}"

    def _read(self) -> None:
        """Keeps the last output, and finds the port in it."""
        process = self._process
        if process is None or process.stdout is None:
            return
        with suppress(ValueError):  # closed at the end
            for line in process.stdout:
                self._lines.append(line[:300])
                address = _URL.search(line)
                if address is not None and self._port is None:
                    self._port = int(address[1])
                    self._listening.set()
        self._listening.set()
