"""A peer at work in a process of its own: words go in, JSON lines come out (see `host`)."""

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

from volery.bench.peers.failure import PeerError, last_line

_HOST = Path(__file__).with_name("host.py")
START_TIMEOUT_S = 300.0
"""For imports, building the scene and the first answer."""
ROUND_TIMEOUT_S = 180.0


class Conversation:
    """Starts `script` with the interpreter `python`; everything fails as PeerError.

    request: what the script's `prepare` gets, as plain data. folder: where it is written.
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
        """Versions of the packages that the request names; waits until the peer is ready."""
        found = {str(k): str(v) for k, v in self._ask("versions").items()}
        self._timeout_s = self._round_timeout_s
        return found

    def round(self) -> float:
        """Let it do a round; seconds that it took by the peer's own clock."""
        try:
            return float(self._ask("round")["seconds"])
        except (KeyError, TypeError, ValueError):
            raise PeerError("answered a round without its seconds") from None

    def facts(self) -> dict[str, Any]:
        """What the script tells for checking."""
        return self._ask("facts")

    def close(self) -> None:
        """End it, and whatever it started."""
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
        # where it has ended, its last line on standard error, read below, says why
        with contextlib.suppress(BrokenPipeError):
            self._words.write(word + "\n")
            self._words.flush()
        try:
            line = self._lines.get(timeout=self._timeout_s)
        except queue.Empty:
            raise PeerError(f"no answer to '{word}' within {self._timeout_s:g} s") from None
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
