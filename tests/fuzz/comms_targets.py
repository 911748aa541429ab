"""What comes over the radio network: frames, and conversations with the server."""

from __future__ import annotations

from volery.comms import control_payloads
from volery.comms.addresses import ALL, SERVER, Identity
from volery.comms.protocol import StationFrameKind, StationFrameParser, encode_frame
from volery.comms.server.router import Router
from volery.comms.server.settings import RouterSettings
from volery.comms.station.core import StationCore

_HELLO = encode_frame(
    StationFrameKind.HELLO,
    1,
    SERVER,
    7,
    payload=control_payloads.encode_hello(control_payloads.Hello(0, 1, 4, "a", "")),
)
_TALK = [
    encode_frame(StationFrameKind.COMMAND, 1, 2, 7, 1, 5, b"command"),
    encode_frame(StationFrameKind.SENSING, 1, ALL, 7, 2, 5, bytes(40)),
    encode_frame(StationFrameKind.SENSING, 1, 9, 7, 3, 5),
    encode_frame(
        StationFrameKind.RECEIVED,
        1,
        SERVER,
        7,
        payload=control_payloads.encode_received([control_payloads.Received(2, 1, 1)]),
    ),
    encode_frame(StationFrameKind.PING, 1, SERVER, 7),
]
_RESPONSES = [
    encode_frame(
        StationFrameKind.WELCOME,
        SERVER,
        1,
        payload=control_payloads.encode_welcome(control_payloads.Welcome(3, 1, (1,))),
    ),
    encode_frame(
        StationFrameKind.SETTLED, SERVER, 1, payload=control_payloads.encode_settled((1, 2))
    ),
    encode_frame(
        StationFrameKind.REFUSAL,
        SERVER,
        1,
        payload=control_payloads.encode_refusal(
            control_payloads.Refusal(control_payloads.Reason.FULL, 2, "full")
        ),
    ),
    encode_frame(StationFrameKind.SENSING, 2, 1, 1, 1, 0, b"x"),
    encode_frame(StationFrameKind.PONG, SERVER, 1),
]
_STREAMS = [b"".join((_HELLO, *_TALK[k:], *_TALK[:k])) for k in range(len(_TALK))]
_BACK = [b"".join((*_RESPONSES[k:], *_RESPONSES[:k])) for k in range(len(_RESPONSES))]
_FROM_2 = encode_frame(
    StationFrameKind.HELLO,
    2,
    SERVER,
    1,
    payload=control_payloads.encode_hello(control_payloads.Hello(0, 2, 4, "b", "")),
) + encode_frame(StationFrameKind.SENSING, 2, 1, 1, 1, 0, b"hello")


def wire(mutator):
    """Every byte is part of a frame, noise, or awaits the rest."""
    parser = StationFrameParser()
    stream = mutator.bytes(_STREAMS + _BACK)
    frames = [one for piece in mutator.cut(stream) for one in parser.feed(piece)]
    frames += parser.finish()
    for one in frames:
        assert encode_frame(*one[:-1]) == one.data
        assert one.data in stream
    assert sum(len(one.data) for one in frames) + parser.noise_bytes == len(stream)
    assert parser.waiting_bytes == 0
    return 1


def router(mutator):
    """A server and a station take what they are given, and what they say is whole."""
    server = Router(RouterSettings(max_corrupt=2), 0, 1)
    one, two = server.connect(0), server.connect(0)
    server.receive(two, _FROM_2, 0)
    for step, piece in enumerate(mutator.cut(mutator.bytes(_STREAMS))):
        server.receive(one, piece, step)
    for connection in (one, two):
        parser, response = StationFrameParser(), server.take(connection, 1)
        assert sum(len(frame.data) for frame in parser.feed(response)) == len(response)
        server.disconnect(connection, 2)
    for seconds in range(1, 8):
        server.tick(seconds * 10**9)
    assert server.statistics.connections == 0
    core = StationCore(Identity(0, 1), 7)
    core.connected(0)
    core.send(StationFrameKind.COMMAND, 2, b"command", 0)
    for piece in mutator.cut(mutator.bytes(_BACK)):
        core.feed(piece, 0)
    core.tick(10**9)
    StationFrameParser().feed(core.take())
    return 2
