"""Signed MAVLink that an attacker recorded and sends again: no vehicle accepts it a second time."""

from __future__ import annotations

import hashlib
import logging
import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from volery.mavlink.codec import dialect
from volery.mavlink.framing import Framer
from volery.mavlink.links import stamp_ledger
from volery.mavlink.links.connection import MavlinkConnection
from volery.mavlink.links.signing import signing_of
from volery.mavlink.links.stamp_ledger import StampFile, Stream

KEY = hashlib.sha256(b"a word among friends").digest()


class Vehicles:
    """Notes what connections bring to vehicles."""

    pause_s = 0.0

    def __init__(self) -> None:
        self.received: list[tuple[int, bytes]] = []

    def send(self, system: int, _link: int, _profile: int, data: bytes) -> None:
        if data:
            self.received.append((system, data))


@pytest.fixture(autouse=True)
def state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    monkeypatch.setattr(stamp_ledger, "_ledgers", {})
    return tmp_path / "state" / "volery"


@pytest.fixture
def vehicles() -> Vehicles:
    return Vehicles()


def restart() -> None:
    stamp_ledger._ledgers.clear()


def connection(vehicles: Vehicles, number: int = 7) -> MavlinkConnection:
    made = MavlinkConnection(vehicles, number, 0, KEY)  # type: ignore[arg-type]
    for system in (1, 2):
        made.greet(system)
    return made


def station(link: int = 3, late_s: float = 0.0) -> Any:
    """A ground station that signs, by pymavlink."""
    mav = dialect().MAVLink(None, 255, 190)
    mav.signing.secret_key = KEY
    mav.signing.link_id = link
    mav.signing.timestamp = int((time.time() - late_s - 1_420_070_400.0) * 100_000)
    mav.signing.sign_outgoing = True
    return mav


def takeoff(mav: Any, system: int = 1) -> bytes:
    command = dialect().MAVLink_command_long_message(system, 1, 22, 0, 0, 0, 0, 0, 0, 0, 5)
    return bytes(command.pack(mav))


def test_a_second_connection_replays_nothing(
    vehicles: Vehicles, caplog: pytest.LogCaptureFixture
) -> None:
    recorded = takeoff(station(), 0) + takeoff(station(link=4), 2)
    connection(vehicles).take(recorded)
    assert len(vehicles.received) == 2
    thief = connection(vehicles, 8)
    thief.take(recorded)
    assert len(vehicles.received) == 2
    assert not thief.has_received
    assert "its time stamps do not rise" in caplog.text


def test_frames_for_no_vehicle_prove_one_connection_only(vehicles: Vehicles) -> None:
    first, thief = connection(vehicles), connection(vehicles, 8)
    recorded = takeoff(station(), 77)
    first.take(recorded)
    thief.take(recorded)
    assert first.has_received
    assert not thief.has_received


def test_a_frame_reaches_each_vehicle_once_over_any_port() -> None:
    """A router sends a frame to the UDP ports of all vehicles; both ports of one are one."""
    (frame,) = Framer().feed(takeoff(station(), 0))
    onboard, ground = signing_of(KEY, 0), signing_of(KEY, 1)
    assert onboard.accepts(frame, 1)
    assert onboard.accepts(frame, 2)
    assert not ground.accepts(frame, 1)
    assert not ground.accepts(frame, 2)


def test_links_of_a_station_do_not_disturb_each_other(vehicles: Vehicles) -> None:
    first, second = station(link=1), station(link=2, late_s=30.0)
    one, other = connection(vehicles), connection(vehicles, 8)
    for _ in range(3):
        one.take(takeoff(first))
        other.take(takeoff(second))
    assert len(vehicles.received) == 6


def test_a_restart_forgets_nothing(vehicles: Vehicles) -> None:
    mav = station(late_s=5.0)
    recorded = takeoff(mav, 0)
    connection(vehicles).take(recorded)
    restart()
    vehicles.received.clear()
    connection(vehicles).take(recorded)
    assert vehicles.received == []
    connection(vehicles).take(takeoff(mav, 0))  # the station itself goes on
    assert len(vehicles.received) == 2


def test_the_end_by_a_signal_forgets_nothing(state: Path) -> None:
    recorded = takeoff(station(late_s=5.0))
    script = (
        "import os, signal\n"
        "from volery.mavlink.framing import Framer\n"
        "from volery.mavlink.links.signing import signing_of\n"
        f"(frame,) = Framer().feed({recorded!r})\n"
        f"assert signing_of({KEY!r}, 0).accepts(frame, 1)\n"
        "os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    ended = subprocess.run(
        [sys.executable, "-P", "-c", script],
        env={**os.environ, "XDG_STATE_HOME": str(state.parent)},
        timeout=900,
        check=False,
    )
    assert ended.returncode == -9
    (frame,) = Framer().feed(recorded)
    assert not signing_of(KEY, 0).accepts(frame, 1)


def test_without_a_file_only_later_messages_count(
    state: Path, caplog: pytest.LogCaptureFixture
) -> None:
    state.parent.mkdir()
    state.write_text("no folder")
    (old,) = Framer().feed(takeoff(station(late_s=1.0)))
    (new,) = Framer().feed(takeoff(station(link=4, late_s=-5.0)))
    with caplog.at_level(logging.WARNING):
        signing = signing_of(KEY, 0)
    assert "file of time stamps cannot be used" in caplog.text
    assert not signing.accepts(old, 1)
    assert signing.accepts(new, 1)


def test_the_file_is_private_and_no_link(state: Path, tmp_path: Path) -> None:
    signing_of(KEY, 0)
    (path,) = state.iterdir()
    assert path.stat().st_mode & 0o777 == 0o600
    assert state.stat().st_mode & 0o777 == 0o700
    assert KEY.hex()[:8] not in path.name
    path.unlink()
    foreign = tmp_path / "foreign"
    foreign.write_text("precious")
    path.symlink_to(foreign)
    restart()
    (frame,) = Framer().feed(takeoff(station(late_s=-5.0)))
    signing_of(KEY, 0).accepts(frame, 1)
    assert foreign.read_text() == "precious"


def test_a_full_file_forgets_the_oldest_stream(state: Path) -> None:
    file = StampFile(state / "stamps")
    for number in range(300):
        file.write(Stream(number % 256, number // 256, 0), 1000 + number)
    found = StampFile(state / "stamps").read()
    assert len(found) == 256
    assert min(found.values()) == 1000 + 300 - 256
    assert found[Stream(299 % 256, 1, 0)] == 1299


def test_two_runs_keep_the_newer_stamp(state: Path) -> None:
    one, other = StampFile(state / "stamps"), StampFile(state / "stamps")
    stream, another = Stream(255, 190, 0), Stream(1, 2, 3)
    one.write(stream, 7)
    other.write(another, 5)
    other.write(stream, 9)
    one.write(stream, 8)
    assert StampFile(state / "stamps").read() == {stream: 9, another: 5}


@pytest.mark.parametrize("content", [b"", b"\x01", b"\xff" * 5000])
def test_a_damaged_file_ends_nothing(state: Path, content: bytes) -> None:
    signing_of(KEY, 0)
    (path,) = state.iterdir()
    path.write_bytes(content)
    restart()
    (frame,) = Framer().feed(takeoff(station()))
    assert signing_of(KEY, 0).accepts(frame, 1)
