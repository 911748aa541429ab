"""What the radio network promises, held against whatever may happen to its connections."""

from __future__ import annotations

from hypothesis import given, settings
from hypothesis import strategies as st
from router_bench import MS, Bench

from volery.comms.addresses import ALL, batch_address
from volery.comms.protocol import StationFrameKind

STATIONS = (0, 1, 4)
RECEIVERS = {
    0: (0,),
    1: (1,),
    4: (4,),
    batch_address(0): (0, 1),
    ALL: STATIONS,
}

station = st.sampled_from(STATIONS)
happenings = st.one_of(
    st.tuples(st.just("send"), station, st.sampled_from(list(RECEIVERS))),
    st.tuples(st.just("send"), station, st.sampled_from(list(RECEIVERS))),
    st.tuples(st.just("cut"), station, st.none()),
    st.tuples(st.just("connect"), station, st.none()),
    st.tuples(st.just("restart"), st.none(), st.none()),
    st.tuples(st.just("run"), st.booleans(), st.none()),
    st.tuples(st.just("half"), station, st.integers(1, 200)),
)


class History:
    """What was sent, by source and receiver, and what happened to which station."""

    def __init__(self) -> None:
        self.bench = Bench()
        self.sent: dict[tuple[int, int], list[bytes]] = {}
        for address in STATIONS:
            self.bench.station(address)

    def happen(self, what, subject, more) -> None:
        bench = self.bench
        if what == "send":
            self.send(subject, more)
        elif what == "cut" and subject in bench.connections:
            bench.cut(subject)
        elif what == "connect" and subject not in bench.connections:
            bench.connect(subject)
        elif what == "restart":
            bench.restart()
        elif what == "run":
            bench.run(50 * MS, acknowledge=subject)
        elif what == "half" and subject in bench.connections:
            self.send_partly(subject, more)

    def send(self, source: int, to: int) -> None:
        receivers = [each for each in RECEIVERS[to] if each != source or to == source]
        count = sum(len(texts) for texts in self.sent.values())
        text = f"{source} {count}"
        self.bench.send(
            source, to, text, StationFrameKind.COMMAND if count % 2 else StationFrameKind.SENSING
        )
        for each in receivers:
            self.sent.setdefault((source, each), []).append(text.encode())

    def send_partly(self, source: int, size: int) -> None:
        """Some bytes get through, then the connection breaks."""
        data = self.bench.cores[source].take()
        self.bench.router.receive(self.bench.connections[source], data[:size], self.bench.now)
        self.bench.cut(source)


@settings(max_examples=150)
@given(st.lists(happenings, max_size=30))
def test_nothing_is_lost_doubled_or_reordered_whatever_breaks(events) -> None:
    history = History()
    for event in events:
        history.happen(*event)
    bench = history.bench
    for address in STATIONS:
        if address not in bench.connections:
            bench.connect(address)
    bench.run(6000 * MS)  # beyond the time for which messages to many are kept
    bench.run(250 * MS)
    for (source, to), texts in history.sent.items():
        got = [text for text in bench.got[to] if text.startswith(f"{source} ".encode())]
        assert got == texts
    assert sum(map(len, bench.got.values())) == sum(map(len, history.sent.values()))
    assert not any(core.unsettled for core in bench.cores.values())
    assert not any(core.refusals for core in bench.cores.values())
