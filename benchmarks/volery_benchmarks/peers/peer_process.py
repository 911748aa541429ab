"""Drives a peer in its own process: command words in, JSON lines out (see `host`)."""

from __future__ import annotations

import contextlib
import json
import os
import queue
import signal
import subprocess
import tempfile
import threading
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import IO, Any, Self

from volery_benchmarks.peers.failure import PeerError, last_line

_HOST = Path(__file__).with_name("host.py")
START_TIMEOUT_S = 300.0
"""For imports, building the scene and the first response, s."""
ROUND_TIMEOUT_S = 180.0


class PeerProcess:
    """Runs `script` with the interpreter `python`; all errors are PeerErrors.

    `request` is the plain data for the script's `prepare`; it is written into `folder`.
    """

    def __init__(
        self,
        python: Path,
        script: Path,
        request: Mapping[str, Any],
        folder: Path,
        *,
        start_timeout_s: float = START_TIMEOUT_S,
        round_timeout_s: float = ROUND_TIMEOUT_S,
    ) -> None:
        file = folder / "request.json"
        file.write_text(json.dumps(dict(request)), encoding="utf-8")
        self._timeout_s = start_timeout_s
        self._round_timeout_s = round_timeout_s
        self._complaints = tempfile.TemporaryFile()  # noqa: SIM115, closed by close()
        self._process = subprocess.Popen(
            [str(python), "-I", str(_HOST), str(script), str(file)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._complaints,
            text=True,
            cwd=folder,
            start_new_session=True,
        )
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._words: IO[str] = self._process.stdin
        self._lines: queue.SimpleQueue[str] = queue.SimpleQueue()
        reader = threading.Thread(target=self._read, args=(self._process.stdout,), daemon=True)
        reader.start()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def versions(self) -> dict[str, str]:
        """Returns the versions of the request's packages; waits until the peer is ready."""
        found = {str(k): str(v) for k, v in self._ask("versions").items()}
        self._timeout_s = self._round_timeout_s
        return found

    def round(self) -> float:
        """Runs a round; returns the seconds that it took by the peer's own clock."""
        try:
            return float(self._ask("round")["seconds"])
        except (KeyError, TypeError, ValueError):
            raise PeerError("responded to a round without its seconds") from None

    def facts(self) -> dict[str, Any]:
        """Returns the script's data for checks."""
        return self._ask("facts")

    def close(self) -> None:
        """Ends the peer and all processes that it started."""
        if self._process.poll() is None:
            os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()
        for stream in (self._process.stdin, self._process.stdout):
            if stream is not None:
                with contextlib.suppress(BrokenPipeError):
                    stream.close()
        self._complaints.close()

    def _read(self, answers: IO[str]) -> None:
        for line in answers:
            self._lines.put(line)
        self._lines.put("")

    def _ask(self, word: str) -> dict[str, Any]:
        # if the peer has ended, the last line of its standard error, read below, has the reason
        with contextlib.suppress(BrokenPipeError):
            self._words.write(word + "\n")
            self._words.flush()
        try:
            line = self._lines.get(timeout=self._timeout_s)
        except queue.Empty:
            raise PeerError(f"no response to '{word}' within {self._timeout_s:g} s") from None
        if not line:
            raise PeerError(self._last_complaint())
        try:
            answer = json.loads(line)
        except json.JSONDecodeError:
            answer = None
        if not isinstance(answer, dict):
            raise PeerError(f"answered '{word}' with {line[:80]!r}, not a JSON object")
        return answer

    def _last_complaint(self) -> str:
        status = self._process.wait()
        self._complaints.seek(0)
        said = last_line(self._complaints.read().decode(errors="replace"))
        return f"ended: {said or f'exit status {status}'}"
