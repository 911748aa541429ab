"""What comes over rosbridge: to our server, and to our client."""

from __future__ import annotations

import base64
import contextlib
import json
from io import BytesIO

import cbor2
import numpy as np
from PIL import Image
from rosbridge_bench import STEPS, STRING, TRIGGER, Bench, trigger_response

from volery.bridges.rosbridge import message_budget
from volery.bridges.rosbridge.client_state import ClientState
from volery.bridges.rosbridge.fragments import Assembly
from volery.bridges.rosbridge.rosapi import RosApi
from volery.bridges.rosbridge.wire import decode_frame, decode_png, encode_json, encode_png
from volery.core.errors import BridgeError, GraphError
from volery.graph.messages import String, message_type
from volery.graph.service_reply import ServiceReply

_GOAL = {"op": "send_action_goal", "id": "g", "action": "/act", "action_type": STEPS}
OPERATIONS = (
    {"op": "advertise", "topic": "/in", "type": "std_msgs/String", "latch": True},
    {"op": "publish", "topic": "/in", "msg": {"data": "x"}},
    {"op": "publish", "topic": "/cmd", "msg": {"linear": {"x": 1.0}, "angular": {"z": 0.5}}},
    {"op": "unadvertise", "topic": "/in"},
    {"op": "subscribe", "topic": "/out", "type": STRING, "id": "s", "compression": "cbor"},
    {"op": "subscribe", "topic": "/out", "throttle_rate": 100, "queue_length": 5},
    {"op": "subscribe", "topic": "/out", "compression": "cbor-raw"},
    {"op": "subscribe", "topic": "/out", "compression": "png", "fragment_size": 10},
    {"op": "unsubscribe", "topic": "/out", "id": "s"},
    {"op": "call_service", "service": "/do", "id": "1", "args": {}, "timeout": 1.5},
    {"op": "call_service", "service": "/do", "args": [], "compression": "png"},
    {"op": "call_service", "service": "/mine", "id": "m"},
    {"op": "call_service", "service": "/rosapi/topics", "id": "r"},
    {"op": "call_service", "service": "/rosapi/message_details", "args": {"type": STRING}},
    {"op": "call_service", "service": "/rosapi/topic_type", "args": {"topic": "/out"}},
    {"op": "call_service", "service": "/rosapi/node_details", "args": {"node": "/first"}},
    {"op": "call_service", "service": "/rosapi/set_param", "args": {"name": "/p", "value": "[1]"}},
    {"op": "call_service", "service": "/rosapi/get_param", "args": {"name": "/p", "default": "1"}},
    {"op": "call_service", "service": "/rosapi/service_type", "args": {"service": "/do"}},
    {"op": "advertise_service", "service": "/mine", "type": TRIGGER},
    {"op": "unadvertise_service", "service": "/mine"},
    {"op": "service_response", "service": "/mine", "id": "service_request:/mine:1",
     "values": {"success": True, "message": "m"}, "result": True},
    {"op": "advertise_action", "action": "/my_act", "type": STEPS},
    {"op": "unadvertise_action", "action": "/my_act"},
    _GOAL | {"args": {"steps": 3}, "feedback": True},
    _GOAL | {"action": "/my_act", "args": {"steps": 3}},
    {"op": "cancel_action_goal", "id": "g", "action": "/act"},
    {"op": "action_feedback", "id": "g", "action": "/my_act", "values": {}},
    {"op": "action_result", "id": "g", "action": "/my_act", "values": {}, "status": 4,
     "result": True},
    {"op": "set_level", "level": "info"},
    {"op": "status", "level": "error", "msg": "x"},
    {"op": "auth", "mac": "x", "token": "y"},
    {"op": "fragment", "id": "f", "data": '{"op":"pub', "num": 0, "total": 2},
    {"op": "fragment", "id": "f", "data": 'lish"}', "num": 1, "total": 2},
)  # fmt: skip

_TEXTS = [json.dumps(operation).encode() for operation in OPERATIONS]
_ARRAYS = {
    "bytes": bytes(8),
    "floats": cbor2.CBORTag(85, np.arange(3, dtype="<f4").tobytes()),
    "shorts": cbor2.CBORTag(65, b"\0\1\0\2"),
}
_BINARIES = [cbor2.dumps(o) for o in (*OPERATIONS, {"op": "publish", "msg": _ARRAYS})]
_IMAGES = [base64.b64decode(json.loads(encode_png(t.decode()))["data"]) for t in _TEXTS[:6]]


def json_frames(mutator):
    """JSON text: an operation that can be written again, or an error."""
    text = mutator.bytes(_TEXTS).decode(errors="replace")
    with contextlib.suppress(BridgeError):
        found = decode_frame(text)
        with contextlib.suppress(BridgeError):
            json.loads(encode_json(found))
    return 1


def cbor_frames(mutator):
    """CBOR: an operation that can be written as JSON, or an error."""
    with contextlib.suppress(BridgeError):
        found = decode_frame(mutator.bytes(_BINARIES))
        with contextlib.suppress(BridgeError):
            json.loads(encode_json(found))
    return 1


def budgets(mutator):
    """What the count lets pass holds no more than the budgets, which are small here."""
    limits = {"MAX_VALUES": 12, "MAX_MEMBERS": 6, "MAX_CONTAINERS": 5, "MAX_APART": 10**9}
    limits |= {"_SMALL_BYTES": 0, "_MIN_RUN": 3, "MAX_TEXT_BYTES": 10**9}
    kept = {name: getattr(message_budget, name) for name in limits}
    is_cbor = mutator.chance(0.6)
    data = mutator.bytes((*_BINARIES, *_ARRAYS) if is_cbor else _TEXTS)
    for name, limit in limits.items():
        setattr(message_budget, name, limit)
    try:
        found = decode_frame(data if is_cbor else data.decode(errors="replace"), limited=True)
    except BridgeError:
        return 1
    finally:
        for name, limit in kept.items():
            setattr(message_budget, name, limit)
    containers, members, values = _held(found)
    assert containers <= 5
    assert members <= 6
    assert values <= 12
    return 1


_ARRAYS = [
    cbor2.dumps({"op": "x", "msg": values})
    for values in ([1] * 9, [0.5] * 9, [300] * 9, [1, 300, 0.5, None] * 2, [[], {}, [1]], ["a"] * 6)
]


def _held(value):
    """Containers, members of maps and values in a decoded message; typed arrays are one value."""
    if not isinstance(value, (dict, list)):
        return 0, 0, 1
    inner = [*value.keys(), *value.values()] if isinstance(value, dict) else value
    counts = [(1, len(value) if isinstance(value, dict) else 0, 0), *map(_held, inner)]
    return tuple(map(sum, zip(*counts, strict=True)))


def _other_images():
    for mode in ("L", "P", "RGBA", "1", "I;16"):
        file = BytesIO()
        Image.new(mode, (5, 4)).save(file, "png")
        yield file.getvalue()


_IMAGES += _other_images()


def images(mutator):
    """PNG in base64."""
    data = base64.b64encode(mutator.bytes(_IMAGES)).decode()
    if mutator.chance(0.1):
        data = mutator.bytes([data.encode()]).decode(errors="replace")
    with contextlib.suppress(BridgeError):
        decode_png({"op": "png", "data": data}, 10_000)
    return 1


def fragments(mutator):
    """Fragments in any order: what is kept is bounded, and nothing is counted wrongly."""
    assembly, max_kept, now_s, whole = Assembly(2000), 0, 0.0, 0
    steps = mutator.random.randrange(1, 30)
    for _ in range(steps):
        total = mutator.random.randrange(1, 5)
        operation = {
            "op": "fragment",
            "id": mutator.pick(("a", "b", 3)),
            "data": "x" * mutator.pick((0, 1, 100, 900)),
            "num": mutator.random.randrange(total),
            "total": total,
        }
        if mutator.chance(0.3):
            operation = mutator.changed(operation)
        now_s += mutator.pick((0.0, 1.0, 20.0))
        with contextlib.suppress(BridgeError):
            whole += assembly.add(operation, now_s) is not None
        kept = [part for message in assembly._open.values() for part in message.parts.values()]
        max_kept = max(max_kept, sum(map(len, kept)))
        assert sum(message.size for message in assembly._open.values()) == assembly._size
    assert max_kept <= 2000
    assembly.drop_old(now_s + 1000.0)
    assert (assembly.waiting, assembly._size) == (0, 0)
    return steps


def _frame(mutator, operations):
    """An operation with changed values as one of the forms that a frame may have."""
    operation = mutator.changed(mutator.pick(operations))
    text = json.dumps(operation, default=bytes.hex)
    fate = mutator.random.random()
    if fate < 0.6:
        return text
    with contextlib.suppress(UnicodeEncodeError):  # half a character
        if fate < 0.9:
            return cbor2.dumps(operation)
        if fate < 0.95:
            return encode_png(text)
        return mutator.bytes([cbor2.dumps(operation)])
    return text


def server(mutator):
    """Two clients of our server, neither of which may break anything."""
    bench = Bench(generation=mutator.pick(("ros1", "ros2")), max_bytes=100_000)
    api = RosApi(bench.gateway, bench.shared.forms.generation, bench.graph.now_ns)
    api.start()
    first, second = bench.peer("first"), bench.peer("second")
    out = bench.graph.advertise("/out", STRING, latched=True)
    bench.graph.create_service("/do", TRIGGER, lambda _: trigger_response(True, "done"))
    goals = []
    bench.graph.actions.create_server("/act", STEPS, goals.append)
    steps = mutator.random.randrange(1, 12)
    for _ in range(steps):
        client = mutator.pick((first, second))
        client.send_raw(_frame(mutator, OPERATIONS))
        bench.now_s += mutator.pick((0.0, 0.2, 40.0))
        if mutator.chance(0.2):
            out.publish(String("ü" * 30))
            bench.graph.deliver()
        for one in (first, second):
            for found in one.frames():
                assert b"internal error" not in _bytes(found), found
    for client in (first, second):
        client.peer.close()
    api.stop()
    assert bench.gateway.sessions() == []
    assert set(bench.graph.services()) == {"/do"}
    assert not any(t.subscribers for t in bench.graph.topics())
    return steps


def _bytes(frame):
    """A frame that we sent, which must be what a client can read."""
    if isinstance(frame, bytes):
        cbor2.loads(frame)
        return frame
    json.loads(frame)
    return frame.encode()


RESPONSES = (
    {"op": "publish", "topic": "/out", "msg": {"data": "x"}},
    {"op": "publish", "topic": "/head", "msg": {"stamp": {"sec": 1, "nanosec": 2}}},
    {"op": "service_response", "id": "call_service:/do:1", "values": {"success": True},
     "result": True},
    {"op": "service_response", "id": "call_service:/rosapi/service_type:2", "result": True,
     "values": {"type": "std_srvs/srv/Trigger"}},
    {"op": "service_response", "id": "call_service:/untyped:3", "result": True, "values": {}},
    {"op": "service_response", "id": "call_service:/do:1", "values": "why", "result": False},
    {"op": "call_service", "service": "/mine", "id": "7", "args": {}},
    {"op": "status", "level": "error", "msg": "no"},
    {"op": "fragment", "id": "f", "data": '{"op":"status",', "num": 0, "total": 2},
    {"op": "fragment", "id": "f", "data": '"msg":"x"}', "num": 1, "total": 2},
)  # fmt: skip


def client(mutator):
    """A server that our client has connected to: nothing it says raises or leaves calls open."""
    state = ClientState(None, lambda: None, mutator.pick(("ros1", "ros2")))
    state.begin(cbor=mutator.chance(0.5))
    calls = []

    def reply():
        calls.append(ServiceReply(lambda _: None, lambda _: None))
        return calls[-1]

    state.subscribe("/out", STRING, 2, False, lambda: None)
    state.subscribe("/head", "std_msgs/msg/Header", 2, False, lambda: None)
    state.advertise("/in", STRING, latched=True)
    response_type = message_type(f"{TRIGGER}_Response")
    state.create_service("/mine", TRIGGER, lambda _, reply: reply.answer(response_type(True, "x")))
    state.call("/do", message_type(f"{TRIGGER}_Request")(), reply())
    state.call("/untyped", None, reply())
    steps = mutator.random.randrange(1, 8)
    for _ in range(steps):
        state.receive(_frame(mutator, RESPONSES), 1.0)
        for found in state.frames():
            _bytes(found)
    state.lose("it is over")
    assert all(call.done for call in calls)
    with contextlib.suppress(GraphError):
        state.destroy_service("/mine", "fuzz")
    return steps
