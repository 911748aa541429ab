"""Rules of the communication server, by the byte and by a clock of the test's own."""

from __future__ import annotations

import pytest
from router_bench import MS, Bench, S

from volery.comms.addresses import ALL, SERVER, Identity, batch_address
from volery.comms.control_payloads import (
    Hello,
    Reason,
    decode_refusal,
    decode_welcome,
    encode_hello,
)
from volery.comms.link_model import Delivery
from volery.comms.local_network import LocalNetwork
from volery.comms.protocol import StationFrameKind, StationFrameParser, encode_frame
from volery.comms.server.router import Router
from volery.comms.server.settings import RouterSettings
from volery.comms.station.core import StationCore
from volery.core.errors import CommsError
from volery.core.framing import Flaw

LATE = 6 * S
"""After the grace of a start."""


def numbered(count: int, start: int = 0) -> list[bytes]:
    return [str(k).encode() for k in range(start, start + count)]


def test_one_batch_and_all() -> None:
    bench = Bench()
    for address in (0, 1, 4, 5, Identity.ground().address()):
        bench.station(address)
    bench.send(0, 5, "one")
    bench.send(0, batch_address(1), "batch")
    bench.send(4, batch_address(1), "mates")
    bench.send(0, ALL, "all")
    bench.run()
    assert bench.got[5] == [b"one", b"mates", b"batch", b"all"]
    assert bench.got[4] == [b"batch", b"all"]
    assert bench.got[1] == [b"all"]
    assert bench.got[0] == []
    assert bench.got[Identity.ground().address()] == [b"all"]


def test_the_server_settles_what_has_come() -> None:
    bench = Bench(now_ns=0)
    one = bench.station(0)
    bench.station(1)
    bench.run(LATE)
    bench.cut(1)
    bench.send(0, 1, "waits")
    bench.run(250 * MS)
    assert one.unsettled == 1
    bench.connect(1)
    bench.run(250 * MS)
    bench.run(250 * MS)
    assert one.unsettled == 0
    assert bench.got[1] == [b"waits"]
    assert bench.router.statistics.stored == 1
    assert bench.router.statistics.delivered == 1


def test_messages_to_unknown_stations_are_refused_with_a_reason() -> None:
    bench = Bench()
    one = bench.station(0)
    bench.run(LATE)
    number = bench.send(0, 9, "?", StationFrameKind.COMMAND)
    bench.run()
    refusal = one.refusals.pop()
    assert (refusal.reason, refusal.sequence) == (Reason.UNKNOWN, number)
    assert "9" in refusal.text
    assert one.unsettled == 0


def test_after_a_start_all_stations_count_as_known_for_a_while() -> None:
    bench = Bench()
    one = bench.station(0)
    bench.send(0, 9, "early")
    bench.send(0, ALL, "to all")
    bench.send(0, 8, "never")
    bench.run(2 * S)
    assert one.unsettled == 3
    bench.station(9)
    assert bench.got[9] == [b"early", b"to all"]
    bench.run(4 * S)
    bench.run(250 * MS)
    assert one.unsettled == 0
    assert [r.reason for r in one.refusals] == [Reason.UNKNOWN]


def test_nothing_is_lost_doubled_or_reordered_when_the_server_is_killed() -> None:
    bench = Bench()
    for address in range(3):
        bench.station(address)
    for k in range(10):
        bench.send(0, 1, str(k))
    bench.run(acknowledge=False)  # they came, but without acknowledgement
    assert bench.got[1] == numbered(10)
    bench.restart()
    for k in range(10, 15):
        bench.send(0, 1, str(k))
    bench.send(0, ALL, "15")
    bench.connect(0)
    bench.send(0, 1, "16")
    bench.run(S)
    bench.connect(1)
    bench.connect(2)
    assert bench.got[1] == numbered(17)
    assert bench.got[2] == [b"15"]
    assert bench.cores[1].duplicates == 10
    bench.run(LATE)
    bench.run(250 * MS)
    assert bench.cores[0].unsettled == 0


def test_nothing_is_lost_or_doubled_when_a_connection_breaks() -> None:
    bench = Bench()
    one, _ = bench.station(0), bench.station(1)
    for k in range(5):
        bench.send(0, 1, str(k))
    bench.run(acknowledge=False)
    bench.cut(0)
    bench.cut(1)
    bench.send(0, 1, "5")
    bench.connect(1)
    bench.connect(0)
    bench.run(250 * MS)
    bench.run(250 * MS)
    assert bench.got[1] == numbered(6)
    assert bench.router.statistics.accepted == 6
    assert bench.router.statistics.duplicates == 0
    assert one.unsettled == 0


def test_messages_of_a_source_that_restarts_are_received() -> None:
    bench = Bench()
    bench.station(1)
    for session in (1, 2, 3):
        bench.station(0, session)
        bench.send(0, 1, str(session))
        bench.run()
        bench.cut(0)
    assert bench.got[1] == [b"1", b"2", b"3"]


def test_a_message_to_many_that_one_refuses_still_comes_to_the_others() -> None:
    bench = Bench(RouterSettings(lane_depth=1))
    for address in range(3):
        bench.station(address)
    bench.run(LATE)
    bench.cut(1)
    bench.send(0, 1, "first", StationFrameKind.COMMAND)
    bench.run()
    bench.send(0, ALL, "to all", StationFrameKind.COMMAND)
    bench.run(acknowledge=False)
    assert [r.reason for r in bench.cores[0].refusals] == [Reason.FULL]
    bench.cut(2)
    bench.cores[2] = bench.station(2, session=2)  # it starts anew and has forgotten all
    bench.restart()
    for address in (0, 2):
        bench.connect(address)
    assert bench.got[2][-1] == b"to all"


def test_the_newest_of_two_with_one_identity_wins() -> None:
    bench = Bench()
    bench.station(1)
    old = bench.station(0)
    old_connection = bench.connections.pop(0)
    bench.station(0, session=2)
    reply = StationFrameParser().feed(bench.router.take(old_connection, bench.now))
    assert decode_refusal(reply[-1].payload).reason is Reason.REPLACED
    assert bench.router.closing(old_connection)
    old.feed(reply[-1].data, bench.now)
    assert old.fatal is not None
    bench.send(1, 0, "to the new one")
    bench.run()
    assert bench.got[0] == [b"to the new one"]
    assert bench.router.statistics.replaced == 1


def test_sources_take_turns() -> None:
    bench = Bench()
    for address in range(4):
        bench.station(address)
    bench.cut(3)
    for source, count in ((0, 100), (1, 3), (2, 3)):
        for k in range(count):
            bench.send(source, 3, f"{source}:{k}")
    bench.run()
    bench.connect(3)
    first = [text.split(b":")[0] for text in bench.got[3][:9]]
    assert first == [b"0", b"1", b"2"] * 3
    assert len(bench.got[3]) == 106


def test_measurements_give_way_and_commands_are_refused() -> None:
    bench = Bench(RouterSettings(lane_depth=4))
    one, _ = bench.station(0), bench.station(1)
    bench.cut(1)
    for k in range(6):
        bench.send(0, 1, f"s{k}")
        bench.send(0, 1, f"c{k}", StationFrameKind.COMMAND)
    bench.run()
    assert [r.reason for r in one.refusals] == [Reason.FULL] * 2
    bench.connect(1)
    assert bench.got[1] == [b"c0", b"c1", b"s2", b"c2", b"s3", b"c3", b"s4", b"s5"]
    statistics = bench.router.statistics
    assert statistics.dropped_sensing == 2
    assert statistics.refused == {Reason.FULL: 2}


def test_a_station_that_never_acknowledges_fills_its_own_queue_only() -> None:
    bench = Bench(RouterSettings(window=5, lane_depth=10))
    one, _, other = bench.station(0), bench.station(1), bench.station(2)
    for k in range(40):
        bench.send(0, 1, str(k))
        bench.send(0, 2, str(k))
        one.tick(bench.now)
        bench.router.receive(bench.connections[0], one.take(), bench.now)
        for address in (1, 2):
            data = bench.router.take(bench.connections[address], bench.now)
            bench.got[address] += [f.payload for f in bench.cores[address].feed(data, bench.now)]
        other.acknowledge(bench.now)
        bench.router.receive(bench.connections[2], other.take(), bench.now)
    assert bench.got[1] == numbered(5)
    assert bench.router.statistics.dropped_sensing == 25  # 40, less 5 in transit and 10 waiting
    assert bench.got[2] == numbered(40)


def test_queues_are_bounded_by_bytes() -> None:
    bench = Bench(RouterSettings(queue_bytes=20_000))
    bench.station(0), bench.station(1)
    bench.cut(1)
    for _ in range(30):
        bench.send(0, 1, "x" * 1000)
    bench.run()
    bench.connect(1)
    assert len(bench.got[1]) == 20_000 // 1032


def test_large_messages_replace_several_small_ones() -> None:
    """One for one they would fill a queue far beyond its bytes."""
    bench = Bench(RouterSettings(queue_bytes=20_000))
    bench.station(0), bench.station(1)
    bench.cut(1)
    for size in (100, 1000):
        for _ in range(200):
            bench.send(0, 1, "x" * size)
    bench.run()
    bench.connect(1)
    assert [len(payload) for payload in bench.got[1]] == [1000] * (20_000 // 1032)


def test_floods_are_cut_off_by_rate() -> None:
    bench = Bench(RouterSettings(rate_messages_s=10.0, burst_messages=20))
    one, _ = bench.station(0), bench.station(1)
    for k in range(30):
        bench.send(0, 1, str(k))
    bench.send(0, 1, "command", StationFrameKind.COMMAND)
    bench.run()
    assert len(bench.got[1]) == 20
    assert bench.router.statistics.flooded == 10
    assert [r.reason for r in one.refusals] == [Reason.RATE]
    bench.run(S)
    bench.send(0, 1, "later")
    bench.run()
    assert bench.got[1][-1] == b"later"


def test_old_messages_expire() -> None:
    bench = Bench(RouterSettings(keep_s=10.0))
    one, _ = bench.station(0), bench.station(1)
    bench.cut(1)
    bench.send(0, 1, "s")
    bench.send(0, 1, "c", StationFrameKind.COMMAND)
    bench.run(12 * S)
    assert [r.reason for r in one.refusals] == [Reason.EXPIRED]
    assert bench.router.statistics.expired == 2
    bench.run(250 * MS)
    assert one.unsettled == 0
    bench.connect(1)
    assert bench.got[1] == []


def test_sensing_for_many_does_not_wait_for_stations_long_away() -> None:
    bench = Bench()
    one, _ = bench.station(0), bench.station(1)
    bench.run(10 * S)
    bench.cut(1)
    for text, to, kind in (
        ("early", ALL, StationFrameKind.SENSING),
        ("mine", 1, StationFrameKind.SENSING),
        ("go", ALL, StationFrameKind.COMMAND),
    ):
        bench.send(0, to, text, kind)
    bench.run(6 * S)
    for k in range(300):
        bench.send(0, ALL, f"late {k}")
        bench.run(200 * MS)
    counted = bench.router.statistics
    assert (counted.waiting, counted.expired) == (0, 3)  # by then a minute has passed
    bench.send(0, 1, "newest")
    bench.run(S)
    assert one.unsettled == 1
    bench.connect(1)
    bench.send(0, ALL, "fresh")
    bench.run()
    assert bench.got[1] == [b"newest", b"fresh"]


def test_sensing_for_many_waits_for_stations_shortly_away() -> None:
    bench = Bench()
    bench.station(0)
    bench.station(1)
    bench.run(10 * S)
    bench.cut(1)
    bench.send(0, ALL, "one")
    bench.run(4 * S)
    bench.send(0, 1, "two")
    bench.connect(1)
    bench.run()
    assert bench.got[1] == [b"one", b"two"]
    bench.cut(1)
    bench.send(0, ALL, "three")
    bench.send(0, 1, "four")
    bench.run(6 * S)
    assert bench.router.statistics.expired == 1
    bench.connect(1)
    assert bench.got[1] == [b"one", b"two", b"four"]


def test_stations_long_gone_are_forgotten() -> None:
    bench = Bench(RouterSettings(forget_s=20.0))
    one, _ = bench.station(0), bench.station(1)
    bench.cut(1)
    for _ in range(22):
        bench.run(S)
    assert bench.router.statistics.away == 0
    bench.send(0, 1, "?")
    bench.run()
    assert [r.reason for r in one.refusals] == [Reason.UNKNOWN]


def test_silent_connections_are_ended() -> None:
    bench = Bench()
    bench.station(0)
    mute = bench.router.connect(bench.now)
    bench.run(int(2.5 * S))
    assert bench.router.closing(mute)
    assert bench.router.statistics.silent == 1


def test_stations_that_only_listen_stay_by_their_pings() -> None:
    bench = Bench()
    bench.station(0)
    for _ in range(20):
        bench.run(S)
    assert bench.router.statistics.present == 1
    bench.now += 10 * S  # hung: nothing said for ten seconds
    bench.router.tick(bench.now)
    assert bench.router.closing(bench.connections[0])
    assert bench.router.statistics.silent == 1


HELLO = encode_hello(Hello(0, 0, 4, "", ""))


@pytest.mark.parametrize(
    ("frame", "reason"),
    [
        (encode_frame(StationFrameKind.PING, 0, SERVER), Reason.PROTOCOL),
        (encode_frame(StationFrameKind.HELLO, 0, SERVER, payload=b"\xff"), Reason.PROTOCOL),
        (encode_frame(StationFrameKind.HELLO, 1, SERVER, payload=HELLO), Reason.IDENTITY),
        (
            encode_frame(
                StationFrameKind.HELLO, 0, SERVER, payload=encode_hello(Hello(0, 7, 4, "", ""))
            ),
            Reason.IDENTITY,
        ),
        (
            encode_frame(
                StationFrameKind.HELLO, 0, SERVER, payload=encode_hello(Hello(0, 0, 3, "", ""))
            ),
            Reason.BATCH_SIZE,
        ),
        (
            encode_frame(StationFrameKind.HELLO, 0, SERVER, payload=HELLO)
            + encode_frame(StationFrameKind.SENSING, 1, 2, 0, 1),
            Reason.PROTOCOL,
        ),
    ],
)
def test_a_station_that_breaks_the_protocol_is_refused_and_disconnected(
    frame: bytes, reason: Reason
) -> None:
    router = Router(RouterSettings(), 0, 1)
    connection = router.connect(0)
    router.receive(connection, frame, 0)
    answer = StationFrameParser().feed(router.take(connection, 0))
    assert decode_refusal(answer[-1].payload).reason is reason
    assert router.closing(connection)
    assert router.statistics.refused == {reason: 1}


def test_tokens() -> None:
    router = Router(RouterSettings(token="öffne"), 0, 1)
    for token, kind in (("falsch", StationFrameKind.REFUSAL), ("öffne", StationFrameKind.WELCOME)):
        connection = router.connect(0)
        hello = encode_hello(Hello(0, 0, 4, "", token))
        router.receive(
            connection, encode_frame(StationFrameKind.HELLO, 0, SERVER, payload=hello), 0
        )
        (answer,) = StationFrameParser().feed(router.take(connection, 0))
        assert answer.kind == kind
    assert decode_welcome(answer.payload).boot == 1


def test_corrupt_and_half_frames_are_counted_and_too_many_end_the_connection() -> None:
    bench = Bench(RouterSettings(max_corrupt=3))
    bench.station(0), bench.station(1)
    whole = encode_frame(StationFrameKind.SENSING, 0, 1, 1, 1, 0, b"whole")
    broken = bytearray(whole)
    broken[-1] ^= 1
    connection = bench.connections[0]
    bench.router.receive(connection, bytes(broken) + whole, bench.now)
    bench.run()
    assert bench.got[1] == [b"whole"]
    for _ in range(3):
        bench.router.receive(connection, bytes(broken), bench.now)
    assert bench.router.closing(connection)
    bench.router.disconnect(connection, bench.now)
    assert bench.router.statistics.corrupt == {Flaw.BODY: 4}
    late = bench.router.connect(bench.now)
    bench.router.receive(late, whole[:-5], bench.now)
    bench.router.disconnect(late, bench.now)
    assert bench.router.statistics.corrupt == {Flaw.BODY: 4, Flaw.CUT: 1}


def test_a_link_may_lose_and_delay_but_never_reorders() -> None:
    def link(time_ns, source, destination, frame):
        number = int(frame.payload)
        return Delivery(lost=number % 3 == 2, delay_ns=(10 - number) * 10 * MS)

    exchange = LocalNetwork(link=link)
    one, two = exchange.join(Identity(0, 0)), exchange.join(Identity(0, 1))
    for k in range(6):
        one.send(StationFrameKind.SENSING, two.address, str(k).encode(), 0)
    times = {}
    for step in range(1, 30):
        for address, frame in exchange.advance(step * 10 * MS):
            assert address == two.address
            times[int(frame.payload)] = step
    # taken in the first step; the first is 100 ms late and those behind it never overtake
    assert list(times) == [0, 1, 3, 4]
    assert set(times.values()) == {11}
    assert exchange.statistics.lost_on_link == 2
    assert one.unsettled == 0


def test_there_is_room_for_so_many_connections() -> None:
    router = Router(RouterSettings(max_connections=2), 0, 1)
    assert [router.connect(0) for _ in range(3)] == [1, 2, None]


def test_a_station_holds_only_so_much() -> None:
    core = StationCore(Identity(0, 0), 1)
    for k in range(1024):
        core.send(StationFrameKind.COMMAND if k % 2 else StationFrameKind.SENSING, 1, b"", k)
    with pytest.raises(CommsError, match="1024"):
        core.send(StationFrameKind.COMMAND, 1, b"", 0)
    for _ in range(512):
        core.send(StationFrameKind.SENSING, 1, b"", 0)
    assert core.unsettled == 1024
    assert core.dropped == 512
    core.send(StationFrameKind.COMMAND, 2, b"", 0)


def test_impossible_settings() -> None:
    with pytest.raises(CommsError, match="planes"):
        RouterSettings(group_size=0)
    with pytest.raises(CommsError, match="lane_depth"):
        RouterSettings(lane_depth=0)
