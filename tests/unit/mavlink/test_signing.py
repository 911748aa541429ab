"""Signed frames, with pymavlink at the other end."""

import contextlib
import hashlib
import threading
import time

import pytest
from autopilot_bench import irises

from volery.bridges.bridge_host import BridgeHost
from volery.core.errors import BridgeError
from volery.mavlink.autopilot.messages.dialect_extensions import available_modes
from volery.mavlink.codec import Codec, Parser, dialect
from volery.mavlink.framing import Framer
from volery.mavlink.links import stamp_ledger
from volery.mavlink.links.signing import Signing, key_of
from volery.mavlink.links.tcp_bridge import MavlinkTcp
from volery.mavlink.scenario_setup import with_autopilots
from volery.runtime import Simulation

mavutil = pytest.importorskip("pymavlink.mavutil")
development = pytest.importorskip("pymavlink.dialects.v20.development")

KEY = hashlib.sha256(b"a word among friends").digest()
NOW_S = 1_800_000_000.0
STAMP = int((NOW_S - 1_420_070_400.0) * 100_000)


def station(key=KEY, stamp=STAMP):
    """A ground station that signs, by pymavlink."""
    mav = dialect().MAVLink(None, 255, 190)
    mav.signing.secret_key = key
    mav.signing.link_id = 3
    mav.signing.timestamp = stamp
    mav.signing.sign_outgoing = key is not None
    return mav


def frame_of(mav, message=None):
    """One of its frames, as it comes out of a stream."""
    message = message or dialect().MAVLink_heartbeat_message(6, 8, 0, 0, 0, 3)
    (frame,) = Framer().feed(message.pack(mav))
    return frame


def ours(**changes):
    return Signing(KEY, clock=lambda: NOW_S, **changes)


def test_pymavlink_takes_what_is_signed():
    codec, signing = Codec(1), ours(link=7)
    message = dialect().MAVLink_attitude_message(1, 0.1, 0.2, 0.3, 0.0, 0.0, 0.0)
    data = signing.sign(codec.pack(message, 0) + codec.pack(message, 1))
    mav = station()
    frames = Framer().feed(data)
    assert len(frames) == 2
    for frame in frames:
        decoded = mav.decode(bytearray(frame.data))
        assert decoded.get_signed()
        assert decoded.get_link_id() == 7
        assert decoded.pitch == pytest.approx(0.2)
        assert Parser().decode(frame.data).roll == pytest.approx(0.1)


def test_messages_that_pymavlink_lacks_are_signed_too():
    """As pymavlink's dialect `development` has them."""
    modes = available_modes(0)
    message = next(mode for mode in modes if mode.mode_name == b"Hold")
    data = ours().sign(Codec(1).pack(message, 0))
    mav = development.MAVLink(None, 255, 190)
    mav.signing.secret_key, mav.signing.timestamp = KEY, STAMP
    mav.signing.allow_unsigned_callback = None
    decoded = mav.decode(bytearray(data))
    assert decoded.get_signed()
    assert (decoded.mode_index, decoded.mode_name) == (message.mode_index, "Hold")
    assert decoded.number_modes == len(modes)


def test_what_pymavlink_signs_is_accepted_once():
    signing, mav = ours(), station()
    first, second = frame_of(mav), frame_of(mav)
    assert signing.accepts(second)
    assert not signing.accepts(second)
    assert not signing.accepts(first)
    assert signing.accepts(frame_of(mav))


@pytest.mark.parametrize(
    ("mav", "why"),
    [
        (station(None), "it sends unsigned frames"),
        (station(bytes(32)), "its signature does not match the key"),
        (station(stamp=STAMP - 6_100_000), "its clock is more than a minute behind"),
    ],
    ids=["unsigned", "another key", "more than a minute old"],
)
def test_unknown_senders_are_refused_and_reported_once(mav, why, caplog):
    signing = ours()
    for _ in range(3):
        assert not signing.accepts(frame_of(mav))
    assert caplog.messages == [f"MAVLink: system 255, component 190 is ignored: {why}"]


def test_a_changed_frame_is_refused():
    frame = frame_of(station())
    for at in range(-13, 0):
        data = bytearray(frame.data)
        data[at] ^= 1
        assert not ours().accepts(frame._replace(data=bytes(data)))


def test_radios_have_no_key():
    status = dialect().MAVLink_radio_status_message(1, 1, 1, 1, 1, 1, 1)
    assert ours().accepts(frame_of(station(None), status))


def test_stamps_follow_the_newest_received():
    signing, mav = ours(), station(stamp=STAMP + 50_000_000)
    assert signing.accepts(frame_of(mav))
    data = signing.sign(Codec(1).pack(dialect().MAVLink_ping_message(0, 0, 0, 0), 0))
    assert int.from_bytes(data[-12:-6], "little") > STAMP + 50_000_000


def test_without_a_key_all_passes():
    data = Codec(1).pack(dialect().MAVLink_ping_message(0, 0, 0, 0), 0)
    assert Signing(None).sign(data) == data
    assert Signing(None).accepts(frame_of(station(None)))
    assert Signing(None).accepts(frame_of(station()))


def test_a_key_is_the_text_of_a_file(tmp_path):
    path = tmp_path / "key.txt"
    path.write_text("a word among friends\n")
    assert key_of(path) == KEY
    path.write_text("\n")
    with pytest.raises(BridgeError, match="is empty"):
        key_of(path)
    with pytest.raises(BridgeError, match="cannot be read"):
        key_of(tmp_path / "nowhere")


def test_a_vehicle_obeys_only_clients_that_have_the_key(caplog, monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    monkeypatch.setattr(stamp_ledger, "_ledgers", {})
    simulation = Simulation(with_autopilots(irises(1)), threads=1)
    run = threading.Thread(target=lambda: simulation.run(60.0, speed=1.0))
    with simulation, BridgeHost(simulation.gateway) as bridges:
        bridge = MavlinkTcp(port=0, key=KEY)
        bridges.open(bridge)
        simulation.gateway.use_low_latency()
        run.start()
        try:
            with station_at(bridge.port, None) as client:
                command(client)
                end = time.monotonic() + 60.0
                while not caplog.messages and time.monotonic() < end:
                    time.sleep(0.01)
                assert caplog.messages == [
                    "MAVLink: system 245, component 0 is ignored: it sends unsigned frames"
                ]
                with station_at(bridge.port, KEY) as friend:
                    command(friend)
                    ack = friend.recv_match(type="COMMAND_ACK", blocking=True, timeout=60.0)
                    assert ack.get_signed()
                assert client.recv_match(type="COMMAND_ACK") is None
        finally:
            simulation.clock.quit()
            run.join()


@contextlib.contextmanager
def station_at(port, key):
    """A station with this key, or without one, that receives the vehicle."""
    link = mavutil.mavlink_connection(f"tcp:127.0.0.1:{port}", source_system=245)
    try:
        if key is not None:
            link.setup_signing(key, allow_unsigned_callback=lambda *_: False)
        assert link.wait_heartbeat(timeout=60.0)
        yield link
    finally:
        link.close()


def command(link):
    """Request the vehicle's position."""
    link.mav.command_long_send(1, 1, 512, 0, 242, 0, 0, 0, 0, 0, 0)
