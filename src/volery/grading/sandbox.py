"""Runs a submission's node in a process of limited reach: bubblewrap where it is installed.

Under bubblewrap the process sees the Python installation, read-only, its own files, an empty /tmp
and the socket of its simulation: no other files, processes or networks. Without it, memory and
time are limited, but files are not hidden.
"""

from __future__ import annotations

import json
import os
import re
import resource
import shutil
import signal
import subprocess
import sys
import sysconfig
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import volery
from volery.core.compiled import cache_root
from volery.grading.submissions import MODULE

_SYSTEM = ("/usr", "/bin", "/sbin", "/lib", "/lib32", "/lib64", "/etc/alternatives")
_FILES = ("/etc/ld.so.cache", "/etc/localtime")
_TMP_BYTES = 256 << 20
_MAX_OUTPUT_BYTES = 1 << 20
_MAX_FILES_OPEN = 256
_TAIL = 4000
"""Last bytes of a process's output that are read."""
_ERROR = re.compile(r"error: |[\w.]*(Error|Exception|Interrupt)\b")


@cache
def bubblewrap() -> str | None:
    """Returns the path of bubblewrap; None: it is not installed, or this system forbids it."""
    found = shutil.which("bwrap")
    if found is None:
        return None
    words = [found, "--unshare-all", "--ro-bind", "/usr", "/usr", "--symlink", "usr/lib", "/lib"]
    words += ["--symlink", "usr/lib64", "/lib64", "/usr/bin/true"]
    tried = subprocess.run(words, capture_output=True, check=False, timeout=60.0)
    return found if tried.returncode == 0 else None


@dataclass(frozen=True)
class NodeCommand:
    """How `volery node` is started for a submission."""

    node: str
    """Class of the node."""
    uav: str
    """UAV that it flies."""
    period_s: float
    """Period of its lock step, s."""
    parameters: Mapping[str, Any]
    """Parameters of the node."""

    def words(self, socket: str) -> list[str]:
        """Returns the command; socket: path of its simulation's socket."""
        words = [sys.executable, "-m", "volery", "node", f"{MODULE}:{self.node}"]
        words += ["--via", f"unix://{socket}", "--namespace", f"/{self.uav}"]
        words += ["--lock-step", f"{self.period_s:g}"]
        for name, value in self.parameters.items():
            words += ["--param", f"{name}:={json.dumps(value)}"]
        return words


class SandboxedNode:
    """The process of a node, which runs until `close`.

    work: folder with the submission's files, the process's working folder. link: folder with the
    socket `graph` of its simulation. memory_mb, cpu_s: limits of its address space and its
    processor time.
    """

    def __init__(
        self, command: NodeCommand, work: Path, link: Path, *, memory_mb: int, cpu_s: float
    ) -> None:
        self._output = work.parent / "output.txt"
        wrapper = bubblewrap()
        if wrapper is None:
            words, folder = command.words(str(link / "graph")), work
        else:
            words = [wrapper, *_walls(work, link), "--", *command.words("/link/graph")]
            folder = Path("/")
        with self._output.open("wb") as output:
            self._process = subprocess.Popen(
                words,
                cwd=folder,
                env=_environment("/tmp" if wrapper else str(work)),
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=subprocess.STDOUT,
                start_new_session=True,
                preexec_fn=lambda: _limit(memory_mb, cpu_s),  # noqa: PLW1509  # no threads in it
            )

    @property
    def has_ended(self) -> bool:
        """Whether the process has ended by itself."""
        return self._process.poll() is not None

    def last_error(self) -> str:
        """Returns the last line of its output that names an error, else the last line."""
        with self._output.open("rb") as file:
            file.seek(max(0, self._output.stat().st_size - _TAIL))
            lines = file.read().decode(errors="replace").splitlines()
        said = [line.strip() for line in lines if line.strip()]
        errors = [line for line in said if _ERROR.match(line)]
        return (errors or said or ["no output"])[-1]

    def close(self) -> None:
        """Ends the process and all that it has started."""
        with suppress(ProcessLookupError):
            os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()

    def __enter__(self) -> SandboxedNode:
        return self

    def __exit__(self, *_exception: object) -> None:
        self.close()


def _limit(memory_mb: int, cpu_s: float) -> None:
    """Limits the calling process and those that it starts."""
    limits = {
        resource.RLIMIT_AS: memory_mb << 20,
        resource.RLIMIT_CPU: max(1, round(cpu_s)),
        resource.RLIMIT_FSIZE: _MAX_OUTPUT_BYTES,
        resource.RLIMIT_NOFILE: _MAX_FILES_OPEN,
        resource.RLIMIT_CORE: 0,
    }
    for kind, value in limits.items():
        resource.setrlimit(kind, (value, value))


def _environment(home: str) -> dict[str, str]:
    """Returns the variables of the process; none of the caller's but the language."""
    return {
        "PATH": "/usr/bin:/bin",
        "HOME": home,
        "LANG": os.environ.get("LANG", "C.UTF-8"),
        "PYTHONPATH": str(_package_root()),
        "PYTHONDONTWRITEBYTECODE": "1",
        "PYTHONHASHSEED": "0",
        "VOLERY_CACHE_DIR": str(cache_root().parent),
        "OMP_NUM_THREADS": "1",
        "OPENBLAS_NUM_THREADS": "1",
    }


def _walls(work: Path, link: Path) -> list[str]:
    """Returns the options of bubblewrap."""
    words = ["--unshare-all", "--die-with-parent", "--new-session", "--proc", "/proc"]
    words += ["--dev", "/dev", "--size", str(_TMP_BYTES), "--tmpfs", "/tmp"]
    for path in dict.fromkeys(_readable()):
        words += ["--ro-bind", path, path]
    words += ["--ro-bind", str(work), "/submission", "--ro-bind", str(link), "/link"]
    return [*words, "--remount-ro", "/", "--chdir", "/submission"]


def _readable() -> Iterator[str]:
    """Yields the files and folders of the system and of Python that exist."""
    paths = [*_SYSTEM, *_FILES, sys.prefix, sys.base_prefix, sys.exec_prefix]
    paths += [sysconfig.get_path(kind) for kind in ("stdlib", "purelib", "platlib")]
    paths += [str(_package_root()), str(cache_root())]
    for path in paths:
        if Path(path).exists() and path != "/":
            yield str(Path(path))


def _package_root() -> Path:
    """Returns the folder from which `volery` is imported."""
    return Path(volery.__file__).resolve().parents[1]
