"""Starting, watching and ending PX4 instances, with a program in place of PX4."""

import contextlib
import itertools
import socket
import sys
import time
from types import SimpleNamespace

import pytest

from volery.cli.bridges import _px4_instances
from volery.cli.flight import RunOptions
from volery.core.errors import BridgeError
from volery.mavlink.hil.px4_bridge import Px4Bridge
from volery.mavlink.hil.px4_processes import FIRST_PORT, Px4Instances, established_ports, find_px4
from volery.vehicle.airframe import load_airframe

NUMBER = 187
"""Of instances that do not connect."""

CONNECTS = """
import os, signal, socket, sys, time
signal.signal(signal.SIGINT, signal.SIG_DFL)
number = int(sys.argv[sys.argv.index("-i") + 1])
print(os.environ["PX4_SIM_MODEL"], os.environ["PX4_SIM_HOSTNAME"], sys.argv[3:], flush=True)
while True:
    try:
        link = socket.create_connection(("127.0.0.1", 4560 + number))
    except OSError:
        time.sleep(0.01)
        continue
    time.sleep(1000)
"""
FAILS = """
import sys
print("PX4 server already running for instance 187")
sys.exit(3)
"""


def make_px4(folder, program):
    """A build's folder with a program in place of PX4."""
    build = folder / "build/px4_sitl_default"
    airframes = build / "etc/init.d-posix/airframes"
    airframes.mkdir(parents=True)
    (airframes / "10016_none_iris").touch()
    binary = build / "bin/px4"
    binary.parent.mkdir()
    binary.write_text(f"#!{sys.executable}{program}")
    binary.chmod(0o755)
    return build


@pytest.fixture
def simulator():
    """Listens where instance `number` connects, the first one whose port is free."""
    for number in range(100, 254):
        with contextlib.suppress(OSError):
            server = socket.create_server(("127.0.0.1", FIRST_PORT + number))
            break
    with server:
        server.settimeout(60.0)
        yield SimpleNamespace(number=number, accept=server.accept)


def test_an_instance_connects_and_ends(tmp_path, simulator):
    build = make_px4(tmp_path, CONNECTS)
    number = simulator.number
    with Px4Instances(find_px4(tmp_path), 1, first=number, folder=tmp_path / "kept"):
        link, _ = simulator.accept()
    with link:
        link.settimeout(60.0)
        assert link.recv(1) == b""
    output = (tmp_path / f"kept/instance_{number}/output.txt").read_text()
    assert output == f"none_iris 127.0.0.1 ['-d', '{build / 'etc'}']\n"


PRINTS_PARAMETERS = """
import os, time
for name in sorted(os.environ):
    if name.startswith("PX4_"):
        print(name, os.environ[name], flush=True)
"""


def test_each_instance_gets_its_parameters_and_the_environments_come_first(tmp_path, monkeypatch):
    make_px4(tmp_path, PRINTS_PARAMETERS)
    monkeypatch.setenv("PX4_PARAM_MPC_THR_HOVER", "0.6")
    monkeypatch.setenv("PX4_HOME_LAT", "47.0")
    own = [{"CA_ROTOR_COUNT": 4, "MPC_THR_HOVER": 0.7}, {"CA_ROTOR0_PX": -0.159}]
    kept = tmp_path / "kept"
    with Px4Instances(find_px4(tmp_path), 2, first=NUMBER, folder=kept, parameters=own) as all_of:
        assert all_of.wait(60.0)
    output = [(kept / f"instance_{NUMBER + k}/output.txt").read_text() for k in range(2)]
    assert "PX4_PARAM_CA_ROTOR_COUNT 4\n" in output[0]
    assert "PX4_PARAM_MPC_THR_HOVER 0.6\n" in output[0]
    assert "ROTOR0" not in output[0]
    assert "PX4_PARAM_CA_ROTOR0_PX -0.159\nPX4_PARAM_MPC_THR_HOVER 0.6\n" in output[1]
    assert "HOME_LAT" not in output[0] + output[1]


@pytest.mark.skipif(established_ports() is None, reason="this system does not list connections")
def test_an_instance_that_lost_its_simulation_restarts(tmp_path, simulator):
    make_px4(tmp_path, CONNECTS)
    with Px4Instances(find_px4(tmp_path), 1, first=simulator.number) as instances:
        first, _ = simulator.accept()
        end = time.monotonic() + 60.0
        while not instances._instances[0]._was_linked and time.monotonic() < end:
            time.sleep(0.01)
        first.close()
        second, _ = simulator.accept()
        second.close()
        assert instances.failure is None


def test_one_that_ends_by_itself_is_reported(tmp_path):
    make_px4(tmp_path, FAILS)
    with Px4Instances(find_px4(tmp_path), 1, first=NUMBER) as instances:
        assert instances.wait(60.0)
    assert instances.failure == (
        "PX4 187 ended with code 3; last output:\n  PX4 server already running for instance 187"
    )


def test_what_is_no_px4_is_reported(tmp_path):
    with pytest.raises(
        BridgeError, match="no such folder; --px4-dir needs the folder of PX4-Autopilot"
    ):
        find_px4(tmp_path / "nowhere")
    with pytest.raises(BridgeError, match="px4 is missing; build it there with `make"):
        find_px4(tmp_path)
    build = make_px4(tmp_path, FAILS)
    assert find_px4(build).binary == build / "bin/px4"
    (build / "bin/px4").chmod(0o644)
    with pytest.raises(BridgeError, match="is not executable"):
        find_px4(tmp_path)
    (build / "bin/px4").chmod(0o755)
    (build / "etc/init.d-posix/airframes/10016_none_iris").unlink()
    with pytest.raises(BridgeError, match="has no airframe none_iris"):
        find_px4(tmp_path)


@pytest.mark.parametrize(("first", "count"), [(0, 0), (-1, 1), (250, 10)])
def test_numbers_beyond_mavlinks_ids_are_refused(tmp_path, first, count):
    make_px4(tmp_path, FAILS)
    with pytest.raises(BridgeError, match="0 to 253 are allowed"):
        Px4Instances(find_px4(tmp_path), count, first=first)


HANGS = """
import pathlib, time
print("INFO [init] waiting for something", flush=True)
pathlib.Path(__file__).with_name("said").touch()
time.sleep(1000)
"""


def test_one_that_never_connects_is_reported_with_its_last_output(tmp_path, monkeypatch):
    output, end = make_px4(tmp_path, HANGS) / "bin/said", time.monotonic() + 60.0
    calls = itertools.count()

    def monotonic():
        """Returns 0 when the wait starts, and a time past its end once there is output."""
        is_start = next(calls) == 0
        return 0.0 if is_start or not (output.exists() or time.monotonic() > end) else 2.0

    monkeypatch.setattr("volery.cli.bridges.time", SimpleNamespace(monotonic=monotonic))
    monkeypatch.setattr("volery.cli.bridges._START_TIMEOUT_S", 1.0)
    uavs = {"uav1": SimpleNamespace(airframe=load_airframe("f450"))}
    options = RunOptions("hover", px4_dir=tmp_path)
    with (
        pytest.raises(BridgeError) as error,
        _px4_instances(uavs, [Px4Bridge()], options),
    ):
        pass
    message = str(error.value)
    assert message.startswith("uav1: PX4 0 has not connected to 127.0.0.1:")
    assert "within 1 s; last output:\n  INFO [init] waiting for something" in message
