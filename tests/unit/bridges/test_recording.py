"""Recordings by patterns, begun and ended while messages flow."""

from __future__ import annotations

import errno
import os
import time

import pytest
from hypothesis import given
from hypothesis import strategies as st
from ros_tcp_client import Loop

from volery.bridges.logs.log_writer import create_log
from volery.bridges.logs.reader import summarize
from volery.bridges.logs.recording import Recorder
from volery.bridges.topic_patterns import renamer, topic_filter
from volery.core.errors import GraphError, RecordingError
from volery.graph.graph import Graph
from volery.graph.messages import String

TOPICS = ("/uav1/laser/horizontal/scan", "/uav1/odom", "/uav2/laser/nodding/scan", "/events")


class Bench:
    def __init__(self):
        self.now_ns = 0
        self.graph = Graph(lambda: self.now_ns)
        self.publishers = {}

    def say(self, topic, text="x"):
        if topic not in self.publishers:
            self.publishers[topic] = self.graph.advertise(topic, String)
        self.now_ns += 1_000_000
        self.publishers[topic].publish(String(text))
        self.graph.deliver()


@pytest.fixture
def bench():
    return Bench()


@pytest.mark.parametrize("suffix", [".mcap", ".bag"])
def test_what_matches_while_it_runs(bench, tmp_path, suffix):
    log = create_log(tmp_path / f"flight{suffix}")
    patterns, exclude = ("/uav*/laser/**", "/late"), ("/**/nodding/*",)
    recorder = Recorder(bench.graph, log, patterns, exclude)
    for topic in TOPICS:
        bench.say(topic)
    recorder.start()
    for topic in (*TOPICS, "/late", *TOPICS):
        bench.say(topic)
    assert recorder.info.running
    recorder.stop()
    recorder.stop()
    for topic in TOPICS:
        bench.say(topic)
    assert recorder.info.messages == 3
    assert not recorder.info.running
    counts = {t.topic: t.messages for t in summarize(log.path).topics}
    assert counts == {"/uav1/laser/horizontal/scan": 2, "/late": 1}
    assert not bench.graph.is_recorded("/a")


def camera(bench, base, *ends):
    """Publishes one message on each topic of a camera; those that are wanted are returned."""
    publishers = {f"{base}{end}": bench.graph.advertise(f"{base}{end}", String) for end in ends}
    wanted = {topic for topic, publisher in publishers.items() if publisher.has_subscribers}
    for publisher in publishers.values():
        publisher.publish(String("x"))
    bench.graph.deliver()
    return wanted


def recorded(bench, path, **options):
    """Topics that are recorded of two cameras, the second without compressed images."""
    recorder = Recorder(bench.graph, create_log(path), **options)
    recorder.start()
    ends = ("/camera_info", "/image_raw", "/depth", "/points", "/labels/instance")
    both = ("/image_raw/compressed", "/depth/compressedDepth")
    wanted = camera(bench, "/uav1/front", *ends, *both) | camera(bench, "/uav1/bare", *ends)
    bench.say("/uav1/points")  # a LIDAR's
    wanted |= {"/uav1/points"} & set(bench.publishers)
    recorder.stop()
    found = {topic.topic for topic in summarize(path).topics}
    assert wanted >= found
    return found, wanted


def test_no_image_is_recorded_twice(bench, tmp_path):
    found, wanted = recorded(bench, tmp_path / "a.mcap")
    assert found == {
        *("/uav1/front/camera_info", "/uav1/front/image_raw/compressed", "/uav1/front/depth"),
        *("/uav1/front/labels/instance", "/uav1/bare/camera_info", "/uav1/bare/image_raw"),
        *("/uav1/bare/depth", "/uav1/bare/labels/instance", "/uav1/points"),
    }
    assert wanted == found  # the others are not even made


def test_patterns_choose_forms_of_images(bench, tmp_path):
    found, wanted = recorded(bench, tmp_path / "a.mcap", topics=["/**/image_raw"])
    assert found == {"/uav1/front/image_raw", "/uav1/bare/image_raw"}
    assert wanted - {"/uav1/points"} == found


def test_everything_can_be_recorded(bench, tmp_path):
    found, _ = recorded(bench, tmp_path / "a.mcap", topics=["/**"])
    assert len(found) == 13


def test_topics_are_left_out(bench, tmp_path):
    found, wanted = recorded(bench, tmp_path / "a.mcap", exclude=["/**/labels/**", "/**/depth"])
    assert not {topic for topic in found | wanted if "labels" in topic or "depth" in topic}
    assert "/uav1/front/image_raw/compressed" in found
    with pytest.raises(GraphError, match="is not a topic pattern"):
        Recorder(bench.graph, create_log(tmp_path / "b.mcap"), exclude=["labels"])


def test_what_was_latched_comes_first(bench, tmp_path):
    bench.graph.advertise("/map", String, latched=True).publish(String("kept"))
    bench.graph.deliver()
    log = create_log(tmp_path / "flight.mcap")
    recorder = Recorder(bench.graph, log)
    bench.now_ns = 77_000_000
    recorder.start()
    bench.graph.deliver()
    recorder.stop()
    summary = summarize(log.path)
    assert (summary.messages, summary.start_ns) == (1, 77_000_000)


def test_from_another_thread(tmp_path):
    loop = Loop()
    log = create_log(tmp_path / "flight.mcap")
    recorder = Recorder(loop.graph, log)
    loop.gateway.post(recorder.start).result(5.0)
    publisher = loop.graph.advertise("/x", String)
    for k in range(10):
        loop.publish(publisher, String(str(k)))
    loop.gateway.post(recorder.stop).result(5.0)
    loop.close()
    assert summarize(log.path).messages == recorder.info.messages == 10


def test_a_full_disk_ends_the_recording_and_nothing_else(bench, tmp_path, monkeypatch):
    log = create_log(tmp_path / "flight.mcap")
    recorder = Recorder(bench.graph, log)
    recorder.start()
    received = []
    bench.graph.subscribe("/x", received.append, String)

    def full(*_arguments):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "pwrite", full)
    for _ in range(30):
        bench.say("/x", os.urandom(80_000).hex())
    assert len(received) == 30
    assert not recorder.info.running
    assert "No space left" in recorder.info.failure
    with pytest.raises(RecordingError, match="No space left"):
        recorder.stop()
    recorder.stop()


def test_one_recorder_records_once(bench, tmp_path):
    recorder = Recorder(bench.graph, create_log(tmp_path / "flight.mcap"))
    recorder.start()
    with pytest.raises(RecordingError, match="before"):
        recorder.start()
    recorder.stop()
    with pytest.raises(RecordingError, match="before"):
        recorder.start()


# ------------------------------------------------------------------------------------ patterns


@pytest.mark.parametrize(
    ("pattern", "matched", "others"),
    [
        ("/**", ["/a", "/a/b", "/"], []),
        ("/*", ["/a"], ["/a/b"]),
        ("/uav?/odom", ["/uav1/odom"], ["/uav12/odom", "/uav/odom", "/uav/1/odom"]),
        ("/uav*/laser/**", ["/uav1/laser", "/uav12/laser/a/b"], ["/uav1/lasers", "/uav1/a/laser"]),
        ("/**/scan", ["/scan", "/a/scan", "/a/b/scan"], ["/ascan", "/a/scan/b"]),
        ("/a/**/b", ["/a/b", "/a/x/b", "/a/x/y/b"], ["/ab", "/a/xb"]),
        ("/a/b", ["/a/b"], ["/a", "/a/b/c", "/a/bb"]),
    ],
)
def test_patterns(pattern, matched, others):
    matches = topic_filter([pattern])
    assert all(matches(topic) for topic in matched)
    assert not any(matches(topic) for topic in others)


@pytest.mark.parametrize(
    "pattern", ["", "a", "uav1/*", "/a b", "/[ab]", "/a/", "//", "/ä(", "/a.b"]
)
def test_what_is_no_pattern(pattern):
    with pytest.raises(GraphError, match="not a topic pattern"):
        topic_filter([pattern])


def test_no_pattern_takes_long():
    hard = "/" + "*a" * 40 + "/**/a" * 20
    began = time.process_time()
    assert not topic_filter([hard])("/" + "a" * 100 + "/a" * 100 + "b")
    assert time.process_time() - began < 0.5


def test_one_pattern_needs_no_list():
    assert topic_filter("/a/*")("/a/b")


@given(st.lists(st.from_regex(r"[a-z_][a-z0-9_]*", fullmatch=True), min_size=1, max_size=4))
def test_a_name_matches_itself_and_the_branches_it_is_in(parts):
    name = "/" + "/".join(parts)
    assert topic_filter([name])(name)
    for k in range(len(parts)):
        assert topic_filter(["/".join(["", *parts[:k], "**"])])(name)


def test_renaming():
    rename = renamer({"/a": "/b", "/uav1/**": "/uav2/**", "/uav1/laser/**": "/x/**"})
    assert [rename(n) for n in ("/a", "/a/b", "/uav1/odom", "/uav1/laser/scan", "/uav11/odom")] == [
        "/b",
        "/a/b",
        "/uav2/odom",
        "/x/scan",
        "/uav11/odom",
    ]
    assert renamer({"/**": "/log/**"})("/uav1/odom") == "/log/uav1/odom"


@pytest.mark.parametrize("names", [{"/a/**": "/b"}, {"/a": "/b/**"}, {"/a*": "/b"}])
def test_what_cannot_be_renamed(names):
    with pytest.raises(GraphError, match="cannot rename"):
        renamer(names)
