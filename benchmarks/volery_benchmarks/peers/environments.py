"""Installs a virtual environment for each peer, once, below the user's cache folder."""

from __future__ import annotations

import fcntl
import hashlib
import os
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from volery.core.compiled import cache_root
from volery.core.private_folders import check_above
from volery_benchmarks.peers.catalogue import Peer
from volery_benchmarks.peers.failure import PeerError, last_line

INSTALL_TIMEOUT_S = 900.0
"""For a peer without a wheel for this machine, which must be compiled, s."""
_DONE = "requirements.txt"


def environment(peer: Peer, root: Path | None = None, timeout_s: float = INSTALL_TIMEOUT_S) -> Path:
    """Returns an interpreter with the pinned requirements of `peer`. Raises `PeerError`.

    `root` is the folder of all such environments, by default in the user's cache. An environment
    with the same requirements is reused.
    """
    root = cache_root() / "peers" if root is None else root
    wanted = "\n".join((f"# Python {sys.version}", *peer.requirements))
    folder = root / f"{peer.name}-{hashlib.sha256(wanted.encode()).hexdigest()[:12]}"
    python = folder / "bin" / "python"
    try:
        root.mkdir(parents=True, exist_ok=True)
        check_above(root.resolve())  # an environment is code
        with (root / f"{folder.name}.lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)  # another bench may be installing the same
            if not (folder / _DONE).is_file():
                _make(folder, python, peer.requirements, timeout_s)
                (folder / _DONE).write_text(wanted + "\n", encoding="utf-8")
    except OSError as error:
        raise PeerError(f"cannot be installed: {error}") from None
    return python


def _make(folder: Path, python: Path, requirements: Sequence[str], timeout_s: float) -> None:
    """Creates an environment; removes it if that fails."""
    shutil.rmtree(folder, ignore_errors=True)
    pip = [str(python), "-I", "-m", "pip", "--disable-pip-version-check", "--no-input"]
    try:
        _run([sys.executable, "-P", "-m", "venv", str(folder)], timeout_s)
        _run([*pip, "install", "--prefer-binary", *requirements], timeout_s)
    except PeerError:
        shutil.rmtree(folder, ignore_errors=True)
        raise


def _run(command: Sequence[str], timeout_s: float) -> None:
    """Runs a command with all its processes. Raises `PeerError` with the last line of output."""
    with tempfile.TemporaryFile() as log:
        process = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=log,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )
        try:
            status = process.wait(timeout_s)
        except subprocess.TimeoutExpired:
            status = None
        finally:
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)
                process.wait()
        log.seek(0)
        said = last_line(log.read().decode(errors="replace"))
    if status is None:
        raise PeerError(f"installing took longer than {timeout_s:g} s; last: {said}")
    if status:
        raise PeerError(f"cannot be installed: {said or f'exit status {status}'}")
