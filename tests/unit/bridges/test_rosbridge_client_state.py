"""The rosbridge client fed with what a server may send, without sockets."""

from __future__ import annotations

import json
from concurrent.futures import Future

import pytest
from rosbridge_bench import TRIGGER

from volery.bridges.rosbridge.client_state import ClientState
from volery.bridges.rosbridge.wire import decode_frame, encode_json
from volery.core.errors import GraphError
from volery.graph.messages import String
from volery.graph.service_reply import ServiceReply


@pytest.fixture
def state():
    state = ClientState(None, lambda: None)
    state.begin(cbor=False)
    return state


def ordered(state):
    """The operations that the client would send."""
    return [json.loads(frame) for frame in state.frames()]


def respond(state, call, values, result=True):
    answer = {"op": "service_response", "id": call["id"], "values": values, "result": result}
    state.receive(json.dumps(answer), 0.0)


@pytest.mark.parametrize("values", [[], [1], "x", 5, {"type": 5}, {"type": "no type"}, {}, None])
def test_a_server_that_misnames_a_service_leaves_no_call_open(state, values):
    """The call without a request asks for the type first; any answer to that is an end."""
    answers, failures = [], []
    state.call("/do", None, ServiceReply(answers.append, failures.append))
    (asked,) = ordered(state)
    assert asked["service"] == "/rosapi/service_type"
    respond(state, asked, values)
    assert not answers
    assert isinstance(failures[0], GraphError)


def test_a_service_is_called_by_the_type_that_the_server_names(state):
    answers = []
    state.call("/do", None, ServiceReply(answers.append, answers.append))
    respond(state, *ordered(state), {"type": "std_srvs/Trigger"})
    respond(state, *ordered(state), {"success": True, "message": "done"})
    assert (answers[0].__msgtype__, answers[0].message) == (f"{TRIGGER}_Response", "done")


@pytest.mark.parametrize("name", ["no type", "/", "a/b/c/d"])
def test_a_request_for_the_type_of_a_topic_fails_on_an_invalid_name(state, name):
    found = Future()
    state.ask_rosapi("topic_type", {"topic": "/a"}, found)
    respond(state, *ordered(state), {"type": name})
    with pytest.raises(GraphError, match="not the name of a ROS type"):
        found.result(0.0)


def test_whatever_breaks_calls_end_with_the_connection(state):
    failures = []
    for service in ("/a", "/b"):
        state.call(service, None, ServiceReply(failures.append, failures.append))
    state.lose("it has left")
    assert [str(failure) for failure in failures] == ["it has left"] * 2


def test_a_response_of_another_type_is_the_callers_error() -> None:
    state = ClientState(None, lambda: None)
    state.begin(cbor=False)
    asked: list[ServiceReply] = []
    state.create_service("/a", "std_srvs/srv/Trigger", lambda _request, reply: asked.append(reply))
    list(state.frames())
    call = {"op": "call_service", "service": "/a", "id": "1", "args": {}}
    state.receive(encode_json(call), 0.0)
    asked[0].answer(String("x"))
    (said,) = map(decode_frame, state.frames())
    assert said["result"] is False
    assert "std_srvs/srv/Trigger_Response" in said["values"]
