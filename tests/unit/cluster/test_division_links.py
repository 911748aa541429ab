"""Links between machines: which workers are admitted, what is refused, what counts as a loss."""

import contextlib
import socket
import struct
import threading

import pytest

from volery.cluster.division import link as links
from volery.cluster.division.joining import serve_leader
from volery.cluster.division.leader import Member
from volery.cluster.division.link import Link, LinkError, admit, apply_to
from volery.cluster.division.workers import DivisionOptions, Workers
from volery.core.errors import DataFileError, DivisionError
from volery.scenario.load import load_scenario

VERSIONS = {"volery": "0.1.0", "numba": "0.68.1"}


def pair():
    ends = socket.socketpair()
    return Link(ends[0], "worker 1"), Link(ends[1], "the leader")


def met(token, versions):
    """Returns what becomes of a worker with this token and these versions, at both ends."""
    leader, worker = pair()
    found = {}

    def serve():
        try:
            admit(leader, "the token", VERSIONS)
        except LinkError as error:
            found["leader"] = str(error)

    thread = threading.Thread(target=serve)
    thread.start()
    try:
        apply_to(worker, token, versions)
    except LinkError as error:
        found["worker"] = str(error)
    thread.join(60.0)
    leader.close()
    worker.close()
    return found


def test_a_worker_with_the_token_is_admitted():
    assert met("the token", VERSIONS) == {}


def test_a_worker_with_another_token_is_refused_with_the_reason():
    assert met("another", VERSIONS) == {
        "leader": "worker 1 was refused: the token is wrong",
        "worker": "the leader refuses this worker: the token is wrong",
    }


def test_a_worker_with_other_versions_is_refused_with_the_reason():
    reason = "it has numba 0.69.0 instead of 0.68.1"
    assert met("the token", {**VERSIONS, "numba": "0.69.0"}) == {
        "leader": f"worker 1 was refused: {reason}",
        "worker": f"the leader refuses this worker: {reason}",
    }


def test_a_leader_that_does_not_know_the_token_is_left():
    leader, worker = pair()

    def pretend():
        leader.send("leader", bytes(32))
        leader.receive()
        leader.send("welcome", bytes(32))

    thread = threading.Thread(target=pretend)
    thread.start()
    with pytest.raises(LinkError, match="the leader does not know the token"):
        apply_to(worker, "the token", VERSIONS)
    thread.join(60.0)
    leader.close()
    worker.close()


@pytest.mark.parametrize(
    ("sent", "reason"),
    [
        (b"GET / HTTP/1.1\r\n\r\n", "worker 1 sends no frames of a divided run"),
        (struct.pack(">I", 3) + b"\xff\xff\xff", "worker 1 sends a broken frame"),
        (struct.pack(">I", 1) + b"\x01", "worker 1 sends a broken frame"),
        (struct.pack(">I", 1) + b"\x80", "worker 1 sends a broken frame"),
        (struct.pack(">I", 8) + b"\x01", "worker 1 is lost: it ended the connection"),
    ],
)
def test_other_bytes_end_the_connection_with_a_reason(sent, reason):
    ends = socket.socketpair()
    ends[1].sendall(sent)
    ends[1].close()
    leader = Link(ends[0], "worker 1")
    with pytest.raises(LinkError, match=reason):
        leader.receive()
    leader.close()


def test_a_silent_machine_is_lost_and_one_that_shows_life_is_not(monkeypatch):
    monkeypatch.setattr(links, "SILENCE_S", 1.0)
    monkeypatch.setattr(links, "_SIGN_S", 0.05)
    leader, worker = pair()
    worker.show_life()
    sent = threading.Timer(3.0, worker.send, ("b", 1))
    sent.start()
    assert leader.receive() == ["b", 1]
    worker._closed.set()  # its signs end, and its connection stays
    with pytest.raises(LinkError, match="worker 1 is lost: no sign of life"):
        leader.receive()
    leader.close()
    worker.close()


def joined(workers):
    """Returns a worker's link to `workers`."""
    link = Link(socket.create_connection(workers._listener.getsockname()), "the leader")
    apply_to(link, "the token", workers._versions)
    return link


def test_a_worker_that_joins_late_is_a_spare_and_learns_of_the_end():
    lines = []
    options = DivisionOptions(1, listen=("127.0.0.1", 0), token="the token")
    with Workers(options, load_scenario("forest_survey"), lines.append) as workers:
        mute = socket.create_connection(workers._listener.getsockname())  # keeps nothing waiting
        first = joined(workers)
        workers._await_others()
        spare = joined(workers)
        found = workers._next_link(60.0)
        assert found.name == "worker 2 (127.0.0.1)"
        address = workers.address
    for link in (first, spare):
        assert link.receive() == ["end", "the run has ended"]
        link.close()
    mute.close()
    assert lines == [
        f"waiting for 1 worker: volery worker --join {address}",
        "worker 1 (127.0.0.1) has joined",
    ]


def test_a_worker_without_files_reads_none_of_its_working_folder(tmp_path, monkeypatch):
    (tmp_path / "secret.csv").write_text("0,1\n1,0\n")
    monkeypatch.chdir(tmp_path)
    terrain = {"kind": "grid", "file": "secret.csv", "spacing_m": 1.0}
    content = {"name": "spy", "world": {"terrain": terrain}, "types": {"a": {}}}
    content["uavs"] = [{"type": "a", "position_m": [0.0, 0.0]}]
    found = []
    with Workers(
        DivisionOptions(1, listen=("127.0.0.1", 0), token="the token"),
        load_scenario("forest_survey"),
        found.append,
    ) as workers:

        def lead():
            workers._await_others()
            link = workers._links[0]
            link.send("job", {"content": content, "files": {}, "uavs": ["uav1"], "repeated": 0})
            found.append(link.receive())
            with contextlib.suppress(LinkError):  # the worker has ended
                link.send("end", "it was not refused")

        thread = threading.Thread(target=lead)
        thread.start()
        with pytest.raises(DataFileError, match=r"no file 'secret\.csv' that may be read"):
            serve_leader(
                workers._listener.getsockname(),
                "the token",
                threads=1,
                trust=False,
                folder=None,
                wait_s=60.0,
                show=found.append,
            )
        thread.join(60.0)
    assert found[-1][0] == "failed"
    assert "secret.csv" in found[-1][1]


class Substitute:
    """A link to a worker that is lost after `frames` frames."""

    def __init__(self, frames):
        self.name, self.left = "", frames

    def send(self, *_frame):
        self.left -= 1
        if self.left < 0:
            raise LinkError("worker 7 is lost: it ended the connection")

    send_bytes = send

    def receive(self):
        return ["ready", 0, {}]

    def close(self):
        """Has nothing to close."""


@pytest.mark.parametrize(("lost", "is_taken_over"), [(0, True), (2, True), (3, False)])
def test_substitutes_may_be_lost_too(monkeypatch, lost, is_taken_over):
    lines = []
    substitutes = [Substitute(1)] * lost + [Substitute(99)]
    with Workers(DivisionOptions(1), load_scenario("forest_survey"), lines.append) as workers:
        monkeypatch.setattr(workers, "_start_here", lambda threads: substitutes.pop(0))
        member = Member(Substitute(99), frozenset({"uav3"}))
        for frame in (["t", [], True, 5, None], ["e", []]):
            member.send(*frame)
        if is_taken_over:
            assert workers._substitute(member, "worker 1 is lost: no sign of life").left == 96
            assert len(lines) == lost + 2
        else:
            with pytest.raises(DivisionError, match="its part was lost 3 times"):
                workers._substitute(member, "worker 1 is lost: no sign of life")
        member.close()
    assert lines[0] == (
        "worker 1 is lost: no sign of life; this machine repeats its part so far and takes it over"
    )


def test_large_frames_come_after_the_greeting_only():
    leader, worker = pair()
    large = bytes(200_000)
    thread = threading.Thread(target=worker.send, args=("b", large))
    leader.show_life()
    thread.start()
    assert leader.receive() == ["b", large]
    thread.join(60.0)
    leader.close()
    worker.close()
