"""Runs `volery serve` in its own process."""

from __future__ import annotations

import json
import re
import subprocess
import sys
import threading
import time
import urllib.request
from collections import deque
from contextlib import suppress
from typing import Any

from volery.core.errors import VoleryError
from volery_benchmarks.ending import end

_STARTING_S = 600.0
"""Max start time, s: the first start compiles, and the machine may be busy."""
_ENDING_S = 20.0
_URL = re.compile(r"http://127\.0\.0\.1:(\d+)/")


class PageProcess:
    """Runs a server and its simulation, as a context manager or with `start` and `stop`.

    Parameters
    ----------
    scenario
        A name, or the path of a TOML file; None: the server's own choice.
    options
        Command-line options.
    port
        Port to listen on; 0: a free one, the same after a restart.

    """

    def __init__(self, scenario: str | None, *options: str, port: int = 0) -> None:
        self.port = port
        named = () if scenario is None else (scenario,)
        self._command = [sys.executable, "-P", "-m", "volery", "serve", *named, *options]
        self._process: subprocess.Popen[str] | None = None
        self._reader = threading.Thread()
        self._output: deque[str] = deque(maxlen=50)

    @property
    def url(self) -> str:
        """URL of the page."""
        return f"http://127.0.0.1:{self.port}/"

    @property
    def rosbridge(self) -> str:
        """URL of the graph's rosbridge."""
        return f"ws://127.0.0.1:{self.port}/rosbridge"

    @property
    def pid(self) -> int:
        """Id of the server's process."""
        if self._process is None:
            raise VoleryError("the server does not run")
        return self._process.pid

    def start(self) -> None:
        """Starts the server and waits until it flies. Raises `VoleryError` with its output."""
        self._process = subprocess.Popen(
            [*self._command, "--port", str(self.port)],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        listening = threading.Event()
        self._reader = threading.Thread(
            target=self._read, args=(self._process, listening), daemon=True
        )
        self._reader.start()
        try:
            if not listening.wait(_STARTING_S) or self._process.poll() is not None:
                raise VoleryError(f"the server did not start: {''.join(self._output)}")
            self.wait_until_flying()
        except BaseException:
            self.stop()
            raise

    def stop(self) -> None:
        """Ends the server."""
        process, self._process = self._process, None
        if process is None:
            return
        end(process)
        self._reader.join(_ENDING_S)
        if process.stdout is not None:
            process.stdout.close()

    def restart(self) -> None:
        """Restarts the server on the same port."""
        self.stop()
        self.start()

    def status(self) -> dict[str, Any]:
        """Returns the content of `./api/status`."""
        with urllib.request.urlopen(f"{self.url}api/status", timeout=10.0) as answer:
            status: dict[str, Any] = json.load(answer)
            return status

    def wait_until_flying(self) -> None:
        """Waits until a simulation runs."""
        ends = time.monotonic() + _STARTING_S
        while time.monotonic() < ends:
            with suppress(OSError):
                if self.status()["state"] == "flying":
                    return
            time.sleep(0.05)
        raise VoleryError(f"no simulation runs: {''.join(self._output)}")

    def __enter__(self) -> PageProcess:
        """Starts the server."""
        self.start()
        return self

    def __exit__(self, *_exception: object) -> None:
        """Ends the server."""
        self.stop()

    def _read(self, process: subprocess.Popen[str], listening: threading.Event) -> None:
        for line in process.stdout or ():
            self._output.append(line)
            address = _URL.search(line)
            if address is not None and not listening.is_set():
                self.port = int(address[1])
                listening.set()
        listening.set()
