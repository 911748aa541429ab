"""Logs of PX4 (ULog) give the values that pyulog reads, also truncated and damaged ones."""

from __future__ import annotations

import struct

import numpy as np
import pytest
from pyulog import ULog

from volery.core.errors import LogWarning, RecordingError
from volery.logs import open_log

MAGIC = b"ULog\x01\x12\x35\x01"
FORMATS = (
    "esc_report:uint32_t rpm;bool ok;uint8_t[3] _padding0;float[2] volts;",
    "esc_status:uint64_t timestamp;uint8_t count;uint8_t[3] _padding0;esc_report[2] esc;",
    "odd:uint8_t flag;uint64_t timestamp;int16_t step;double x;char[4] name;",
)


def message(kind: str, payload: bytes) -> bytes:
    return struct.pack("<HB", len(payload), ord(kind)) + payload


def flags(appended: int = 0, needed: int = 0) -> bytes:
    return message("B", bytes(8) + bytes((needed,)) + bytes(7) + struct.pack("<3Q", appended, 0, 0))


def definitions() -> list[bytes]:
    return [
        *(message("F", text.encode()) for text in FORMATS),
        message("I", b"\x0achar[3] abcabc"),
        message("A", struct.pack("<BH", 0, 0) + b"esc_status"),
        message("A", struct.pack("<BH", 0, 7) + b"odd"),
        message("A", struct.pack("<BH", 1, 8) + b"odd"),
    ]


def samples(count: int = 50) -> list[bytes]:
    found = []
    for k in range(count):
        report = struct.pack("<I?3x2f", 1000 + k, k % 2 == 0, 0.5 * k, 1.0)
        found.append(message("D", struct.pack("<HQB3x", 0, 1000 * k, k) + report + report))
        for number in (7, 8):
            data = struct.pack("<BQhd4s", number, 1000 * k, -k, 0.1 * k, b"abcd")
            found.append(message("D", struct.pack("<H", number) + data))
    text = b"4" + struct.pack("<Q", 20_000) + "Failsafe: \u00b0".encode()
    return [*found, message("O", b"\x05\x00"), message("L", text)]


@pytest.fixture
def whole() -> bytes:
    return b"".join([MAGIC + struct.pack("<Q", 0), flags(), *definitions(), *samples()])


@pytest.fixture
def path(tmp_path, whole):
    file = tmp_path / "px4.ulg"
    file.write_bytes(whole)
    return file


def test_columns_are_those_of_pyulog(path):
    theirs = {(data.name, data.multi_id): data.data for data in ULog(str(path)).data_list}
    with open_log(path) as log:
        assert [(name, count.messages) for name, count in log.topics.items()] == [
            ("/esc_status", 50),
            ("/logged_messages", 1),
            ("/odd", 50),
            ("/odd_1", 50),
        ]
        assert (log.start_s, log.end_s, log.problem) == (0.0, 0.049, "")
        odd = log["/odd_1"]
        assert np.array_equal(odd.times_ns, theirs["odd", 1]["timestamp"] * 1000)
        for field in ("flag", "step", "x", "timestamp"):
            assert np.array_equal(odd[field], theirs["odd", 1][field]), field
            assert odd[field].dtype == theirs["odd", 1][field].dtype
        assert odd["name"][0].tobytes() == b"abcd"
        status = log["/esc_status"]
        for ours, other in (("esc_1_rpm", "esc[1].rpm"), ("esc_0_ok", "esc[0].ok")):
            assert np.array_equal(status[ours], theirs["esc_status", 0][other])
        volts = [theirs["esc_status", 0][f"esc[0].volts[{k}]"] for k in (0, 1)]
        assert np.array_equal(status["esc_0_volts"], np.stack(volts, axis=1))
        texts = log["/logged_messages"]
        assert (texts["severity"].tolist(), texts["text"].tolist()) == ([4], ["Failsafe: \u00b0"])
        assert texts.times_s.tolist() == [0.02]


def test_ranges_of_time_and_tables(path):
    log = open_log(path).between(0.010, 0.020)
    assert log["/odd"]["step"].tolist() == list(range(-10, -20, -1))
    table = log.to_pandas("/odd", ["x", "flag"])
    assert np.allclose(table.index, 0.001 * np.arange(10, 20))


def test_a_truncated_log(path, whole):
    path.write_bytes(whole[:-700])
    with pytest.warns(LogWarning, match=r"px4\.ulg: "):
        log = open_log(path)
    assert log.problem.startswith("cut off in the middle of a message at byte ")
    assert 20 < len(log["/odd"]) < 50
    assert log["/odd"]["step"].tolist() == [-k for k in range(len(log["/odd"]))]


SYNC = message("S", bytes.fromhex("2f731320250cbb12"))
UNKNOWN = struct.pack("<HB", 16, 7)


def counts(log, name="/odd"):
    return log.topics[name].messages


def test_a_damaged_log(path, whole):
    """Without synchronization messages, a row of whole messages shows where the log goes on."""
    middle = whole.index(samples()[60])
    path.write_bytes(whole[:middle] + b"\x01\x00\x00" + whole[middle:])
    with pytest.warns(LogWarning, match=r"px4\.ulg: "):
        log = open_log(path)
    assert log.problem == f"damaged at byte {middle}: 3 bytes skipped"
    assert counts(log) == 50
    assert log["/odd"]["step"].tolist() == [-k for k in range(50)]


@pytest.mark.parametrize("garbage", [UNKNOWN * 33, b"\xff\xff", bytes(5000), b"\xff" * 70_001])
def test_a_log_that_is_damaged_in_the_middle(path, whole, garbage):
    """The whole messages between the damage and the next synchronization message are read, too."""
    parts = [part for sample in samples() for part in (sample, SYNC)]
    parts[63:63] = [samples()[k] for k in (0, 3, 6)]  # without synchronization messages
    start = whole[: whole.index(samples()[0])]
    before = start + b"".join(parts[:60])
    path.write_bytes(before + garbage + b"".join(parts[60:]))
    with pytest.warns(LogWarning, match=r"px4\.ulg: "):
        log = open_log(path)
    assert log.problem == f"damaged at byte {len(before)}: {len(garbage):,} bytes skipped"
    theirs = {(data.name, data.multi_id): data.data for data in ULog(str(path)).data_list}
    assert counts(log) == 50 >= len(theirs["odd", 0]["timestamp"])
    assert counts(log, "/esc_status") == 53
    assert log["/odd"]["step"].tolist() == [-k for k in range(50)]


def test_two_damaged_records_and_lost_bytes(path, whole):
    parts = [part for sample in samples() for part in (sample, SYNC)]
    parts[20] = parts[20][:-7]  # the length of the message leads into the next one
    parts[80] = b"\xf0\xff" + parts[80][2:]  # its length leads far beyond the end
    start = whole[: whole.index(samples()[0])]
    path.write_bytes(start + b"".join(parts))
    with pytest.warns(LogWarning, match="damaged at 2 places, the first at byte "):
        log = open_log(path)
    assert [counts(log, name) for name in ("/esc_status", "/odd", "/odd_1")] == [50, 49, 50]


NEWS = [message("Z", b"news"), message("z", b"\1"), message("#", bytes(300)), message("Z", b"\0")]
EMPTY = message("Z", b"")


@pytest.mark.parametrize("is_synced", [False, True])
@pytest.mark.parametrize("news", [NEWS[:1], NEWS, NEWS * 400, [EMPTY, *NEWS]])
def test_messages_of_later_versions_are_skipped(path, whole, news, is_synced):
    """One, several in a row, before the first sample, between samples, and at the end."""
    first, middle = whole.index(samples()[0]), whole.index(samples()[60])
    added = b"".join([SYNC * is_synced, *news])
    path.write_bytes(added.join([whole[:first], whole[first:middle], whole[middle:], b""]))
    log = open_log(path)
    assert log.problem == ""
    assert [counts(log, name) for name in ("/esc_status", "/odd", "/odd_1")] == [50, 50, 50]
    if EMPTY not in news:  # pyulog takes an empty one for damage
        theirs = {(data.name, data.multi_id): data.data for data in ULog(str(path)).data_list}
        assert np.array_equal(log["/odd"]["x"], theirs["odd", 0]["x"])


@pytest.mark.parametrize(
    "garbage",
    [
        b"\x04\0Z",  # a length that leads into the next message
        b"\xff\x01Zgarbage",  # over messages for synchronization
        message("Z", b"news") + b"\x02\0\x07",
        message("Z", b"news") + bytes(40),
        b"The quick brown fox jumps over the lazy dog",
        np.random.default_rng(5).bytes(3000),
    ],
)
def test_garbage_is_no_message_of_a_later_version(path, whole, garbage):
    parts = [part for sample in samples() for part in (sample, SYNC)]
    start = whole[: whole.index(samples()[0])]
    before = start + b"".join(parts[:60])
    path.write_bytes(before + garbage + b"".join(parts[60:]))
    with pytest.warns(LogWarning, match=r"px4\.ulg: "):
        log = open_log(path)
    assert log.problem.startswith("damaged at byte ")
    assert counts(log) == 50
    assert log["/odd"]["step"].tolist() == [-k for k in range(50)]


@pytest.mark.parametrize("cut", [0, 5])
def test_data_appended_after_a_crash(path, cut):
    """The last message before the appended data may be cut off."""
    head = MAGIC + struct.pack("<Q", 0)
    first, last = samples()[:30], samples()[30:60]
    start = b"".join([head, flags(), *definitions(), *first])
    start = start[: len(start) - cut]
    body = start[len(head) + len(flags()) :]
    path.write_bytes(head + flags(len(start), 1) + body + b"".join(last))
    log = open_log(path)
    assert log.problem == ""
    assert log.topics["/odd"].messages == 20
    assert log.topics["/odd_1"].messages == 20 - (cut > 0)


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("bad:uint64_t timestamp;other x;", "format 'other' is missing or nested too deep"),
        ("bad:uint64_t timestamp;bad x;", "format 'bad' is missing or nested too deep"),
        ("bad:uint64_t timestamp;uint8_t[99999] x;", "would have more than 65536 bytes"),
        ("bad:uint64_t timestamp;nil[99999] x;", "has more than 20000 fields"),
        ("bad:uint64_t timestamp;uint8_t x/../y;", "has the invalid field 'uint8_t x/../y'"),
        ("bad:uint8_t x;", "topic 'bad' has no field 'uint64_t timestamp'"),
    ],
)
def test_an_invalid_topic_is_left_out(path, whole, text, problem):
    added = [message("F", text.encode()), message("F", b"nil:")]
    added.append(message("A", struct.pack("<BH", 0, 99) + b"bad"))
    added.append(message("D", struct.pack("<HQ", 99, 0) + bytes(50)))
    at = len(MAGIC) + 8 + len(flags())
    path.write_bytes(whole[:at] + b"".join(added) + whole[at:])
    with pytest.warns(LogWarning, match=r"px4\.ulg: "):
        log = open_log(path)
    assert problem in log.problem
    assert len(log["/odd"]) == 50
    assert "/bad" not in log


def test_no_ulog_and_unknown_features(path):
    path.write_bytes(b"something else")
    with pytest.raises(RecordingError, match=r"px4\.ulg: is no ULog of PX4"):
        open_log(path)
    path.write_bytes(MAGIC + bytes(8) + flags(needed=2))
    with pytest.raises(RecordingError, match="needs features of ULog that are not known"):
        open_log(path)
    with pytest.raises(RecordingError, match="cannot read the log: No such file"):
        open_log(path.with_name("none.ulg"))


@pytest.mark.parametrize("name", ["flight.ulog", "flight", "flight.bin"])
def test_the_content_identifies_the_format(path, name):
    with open_log(path.rename(path.with_name(name))) as log:
        assert len(log["/odd"]) == 50


def test_an_instance_that_is_named_like_another_topic(path, whole):
    at = len(MAGIC) + 8 + len(flags())
    added = [
        message("F", b"odd_1:uint64_t timestamp;int32_t q;"),
        message("A", struct.pack("<BH", 0, 30) + b"odd_1"),
        message("D", struct.pack("<HQi", 30, 5, 6)),
    ]
    path.write_bytes(whole[:at] + b"".join(added) + whole[at:])
    with open_log(path) as log:
        assert [counts(log, name) for name in ("/odd", "/odd/1", "/odd_1")] == [50, 50, 1]
        assert log["/odd_1"]["q"].tolist() == [6]


def test_times_that_ros_cannot_represent_are_named(path, whole):
    late = message("D", struct.pack("<HBQhd4s", 7, 1, 1 << 62, 0, 0.0, b""))
    path.write_bytes(whole + late)
    with pytest.warns(LogWarning, match="/odd has times later than ROS can represent; left out"):
        log = open_log(path)
    assert counts(log) == 50


def test_a_suffix_in_capitals(path):
    renamed = path.rename(path.with_name("FLIGHT.ULG"))
    with open_log(renamed) as log:
        assert len(log["/odd"]["x"]) == 50
