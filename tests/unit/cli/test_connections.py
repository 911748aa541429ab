"""Waiting for a graph that is not there yet."""

import pytest

from volery.cli import connections
from volery.core.errors import BridgeError, UnreachableError


def test_nodes_wait_for_their_graph_and_say_so(monkeypatch, capsys) -> None:
    tries = []

    def open_link(via: str, name: str) -> str:
        tries.append(name)
        if len(tries) < 3:
            raise UnreachableError(f"no server at {via}")
        return "link"

    monkeypatch.setattr(connections, "open_link", open_link)
    monkeypatch.setattr(connections, "_AGAIN_S", 0.0)
    assert connections.await_link("x://y", "node") == "link"
    assert capsys.readouterr().err == "no server at x://y; waiting up to 30 s\n"
    tries.clear()
    with pytest.raises(UnreachableError):
        connections.await_link("x://y", "node", timeout_s=0.0)
    assert tries == ["node"]


def test_what_never_comes_is_not_waited_for(capsys) -> None:
    with pytest.raises(BridgeError, match="is not a graph connection"):
        connections.await_link("pigeon://post", "node")
    assert capsys.readouterr().err == ""


def test_a_graph_that_goes_and_comes_is_reported_once_each(capsys) -> None:
    class Line:
        connected = True

    line = Line()
    monitor = connections.ConnectionMonitor(line, "x://y")
    for connected in (True, False, False, True, True):
        line.connected = connected
        assert monitor() is False
    assert capsys.readouterr().err == (
        "the graph at x://y is disconnected; waiting for it\n"
        "the graph at x://y is connected again\n"
    )
    assert (
        connections.ConnectionMonitor(object(), "ros2")() is False
    )  # whose link does not say whether it is connected
    assert capsys.readouterr().err == ""
