"""Starts and stops PX4's software-in-the-loop instances beside a running simulation.

    with Px4Instances(find_px4(folder), count=4):
        ...             # they connect to TCP 4560 + i

PX4 must have been built before, for example by `make px4_sitl_default`. An instance whose
connection to a simulation has ended restarts and waits for the next one: PX4 cannot go back in
time.
"""

from __future__ import annotations

import contextlib
import logging
import os
import shutil
import signal
import subprocess
import tempfile
import threading
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from volery.core.errors import BridgeError
from volery.core.whole_files import open_new

AIRFRAME = "none_iris"
"""PX4's airframe 10016: an Iris with an external simulator."""
FIRST_PORT = 4560
_BUILD_PATHS = ("build/px4_sitl_default", "", "build/px4_sitl_nolockstep")
"""Paths below the folder: PX4's sources, a build's folder or an installation."""
_LOOK_S = 0.2
_EXIT_TIMEOUT_S = 3.0
"""Wall time in which an instance may exit by itself."""
_NUM_REPORTED_LINES = 5
MAX_INSTANCES = 254
"""Limit of MAVLink's system ids: instance i has i + 1; 255 is a ground station's."""
_ESTABLISHED = "01"
_log = logging.getLogger(__name__)


class Px4Build(NamedTuple):
    """Paths that are needed to run PX4."""

    binary: Path
    data: Path
    """PX4's folder `etc` of start scripts."""


def find_px4(folder: Path) -> Px4Build:
    """Finds PX4 in its folder of sources, of a build or of an installation.

    PX4 must have the airframe `AIRFRAME`. Raises `BridgeError` if there is no such PX4.
    """
    if not folder.is_dir():
        raise BridgeError(f"{folder}: no such folder; --px4-dir needs the folder of PX4-Autopilot")
    for path in _BUILD_PATHS:
        build = Px4Build(folder / path / "bin/px4", folder / path / "etc")
        if build.binary.is_file():
            _check(build)
            return Px4Build(build.binary.resolve(), build.data.resolve())
    missing = folder / _BUILD_PATHS[0] / "bin/px4"
    raise BridgeError(
        f"{folder} holds no PX4 for simulations: {missing} is missing; build it "
        "there with `make px4_sitl_default`"
    )


def _check(build: Px4Build) -> None:
    if not os.access(build.binary, os.X_OK):
        raise BridgeError(f"{build.binary} is not executable")
    airframes = build.data / "init.d-posix/airframes"
    if not any(airframes.glob(f"[0-9]*_{AIRFRAME}")):
        raise BridgeError(f"{airframes} has no airframe {AIRFRAME}: is this PX4 1.14 or newer?")


class Px4Instances:
    """Runs instances `first` to `first + count - 1`; a context manager, or `start` and `stop`.

    Instance i has the system id i + 1 and connects to `host` at port 4560 + i.

    folder: contains each instance's folder of parameters and logs, which stays; None: a temporary
    folder. speed: real-time factor by which the timeouts of radio links scale. parameters: PX4's
    parameters of each instance; environment variables `PX4_PARAM_NAME` take precedence.
    """

    def __init__(
        self,
        build: Px4Build,
        count: int,
        *,
        first: int = 0,
        host: str = "127.0.0.1",
        folder: Path | None = None,
        speed: float | None = None,
        parameters: Sequence[Mapping[str, float]] = (),
    ) -> None:
        if count < 1 or first < 0 or first + count > MAX_INSTANCES:
            last = MAX_INSTANCES - 1
            raise BridgeError(f"instances {first} to {first + count - 1}: 0 to {last} are allowed")
        self._build = build
        self._numbers = range(first, first + count)
        self._environment = _environment(host, speed)
        self._parameters = tuple(parameters) or ({},) * count
        self._work_dir = folder
        self._folder = Path()
        self._instances: list[_Instance] = []
        self._ended = threading.Event()
        self._monitor = threading.Thread(target=self._watch, name="volery-px4", daemon=True)
        self.failure: str | None = None
        """Why an instance exited by itself; None without a failure."""

    def start(self) -> None:
        """Starts all instances. Raises `BridgeError` if that fails."""
        self._folder = self._work_dir or Path(tempfile.mkdtemp(prefix="volery-px4-"))
        try:
            for number, own in zip(self._numbers, self._parameters, strict=True):
                environment = {**_parameter_variables(own), **self._environment}
                instance = _Instance(self._build, number, self._folder, environment)
                self._instances.append(instance)
                instance.start()
        except OSError as error:
            self.stop()
            raise BridgeError(f"{self._build.binary}: {error.strerror or error}") from None
        self._monitor.start()

    def stop(self) -> None:
        """Ends all instances; further calls do nothing."""
        self._ended.set()
        if self._monitor.is_alive():
            self._monitor.join()
        for instance in self._instances:
            instance.request_exit()
        for instance in self._instances:
            instance.end()
        self._instances.clear()
        if self._work_dir is None and self._folder.name:
            shutil.rmtree(self._folder, ignore_errors=True)

    def output_of(self, number: int) -> str:
        """Returns an instance's last output, indented lines; empty for an unknown instance."""
        found = [one for one in self._instances if one.number == number]
        return "".join(f"\n  {line}" for one in found for line in one.lines())

    def wait(self, timeout_s: float) -> bool:
        """Waits up to `timeout_s`; returns whether an instance has failed or all were stopped."""
        return self._ended.wait(timeout_s)

    def __enter__(self) -> Px4Instances:
        self.start()
        return self

    def __exit__(self, *_exception: object) -> None:
        self.stop()

    def _watch(self) -> None:
        while not self._ended.wait(_LOOK_S):
            links = established_ports()
            for instance in self._instances:
                if instance.has_ended:
                    self.failure = instance.exit_report()
                    _log.error("%s", self.failure)
                    self._ended.set()
                    return
                if instance.was_left(links):
                    _log.info("PX4 %d has lost its simulation and restarts", instance.number)
                    instance.end()
                    instance.start()


class _Instance:
    """One PX4 process."""

    def __init__(
        self, build: Px4Build, number: int, folder: Path, environment: Mapping[str, str]
    ) -> None:
        self.number = number
        self._build, self._environment = build, environment
        self._folder = folder / f"instance_{number}"
        self._output = self._folder / "output.txt"
        self._process: subprocess.Popen[bytes] | None = None
        self._was_linked = False

    def start(self) -> None:
        """Starts the process. Raises `OSError` if that fails."""
        self._folder.mkdir(parents=True, exist_ok=True)
        self._was_linked = False
        with open_new(self._output) as output:
            self._process = subprocess.Popen(
                [self._build.binary, "-i", str(self.number), "-d", self._build.data],
                cwd=self._folder,
                env=self._environment,
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )

    @property
    def has_ended(self) -> bool:
        """Whether the process exited by itself."""
        return self._process is not None and self._process.poll() is not None

    def was_left(self, links: frozenset[int] | None) -> bool:
        """Returns whether the connection to a simulation has ended since the last call."""
        linked = links is not None and FIRST_PORT + self.number in links
        left = links is not None and self._was_linked and not linked
        self._was_linked = linked
        return left

    def exit_report(self) -> str:
        """Returns the exit code and the last output."""
        code = None if self._process is None else self._process.returncode
        lines = self.lines()
        head = f"PX4 {self.number} ended with code {code}"
        return "\n  ".join([f"{head}; last output:", *lines]) if lines else head

    def lines(self) -> list[str]:
        """Returns the last lines of output."""
        try:
            return self._output.read_text(errors="replace").splitlines()[-_NUM_REPORTED_LINES:]
        except OSError:
            return []

    def request_exit(self) -> None:
        """Asks the process to exit."""
        self._signal(signal.SIGINT)

    def end(self) -> None:
        """Ends the process, by force if needed."""
        if self._process is None:
            return
        self._signal(signal.SIGINT)
        try:
            self._process.wait(_EXIT_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            self._signal(signal.SIGKILL)
            self._process.wait()
        self._process = None

    def _signal(self, number: signal.Signals) -> None:
        if self._process is not None:
            with contextlib.suppress(ProcessLookupError, PermissionError):
                os.killpg(self._process.pid, number)


def _environment(host: str, speed: float | None) -> dict[str, str]:
    """Returns the environment of PX4's start scripts; only parameters pass of PX4_ variables."""
    environment = {
        name: value
        for name, value in os.environ.items()
        if not name.startswith("PX4_") or name.startswith("PX4_PARAM_")
    }
    environment |= {"PX4_SIM_MODEL": AIRFRAME, "PX4_SIM_HOSTNAME": host}
    if speed not in (None, 1.0):  # PX4's script needs the program bc for it
        environment["PX4_SIM_SPEED_FACTOR"] = f"{speed:g}"
    return environment


def _parameter_variables(parameters: Mapping[str, float]) -> dict[str, str]:
    """Returns the variables by which PX4's start script sets parameters."""
    return {f"PX4_PARAM_{name}": f"{value:g}" for name, value in parameters.items()}


def established_ports() -> frozenset[int] | None:
    """Returns the remote ports of TCP connections of this machine; None if unknown."""
    ports: set[int] = set()
    try:
        for line in Path("/proc/net/tcp").read_text().splitlines()[1:]:
            _, _, remote, state, *_ = line.split()
            if state == _ESTABLISHED:
                ports.add(int(remote.rpartition(":")[2], 16))
    except OSError:
        return None
    return frozenset(ports)
