"""Runs one node of the bench `search` in its own process.

    python -m volery_benchmarks.search_peer rosbridge|ros1 PORT called|calling CALLS

PORT is that of the bridge on this computer, 0 with ros1, whose master the environment names.
`called` runs the node of a cooperative search, which returns the start time of its handler and ends
with its input; `calling` calls the node CALLS times. Both print JSON.
"""

from __future__ import annotations

import json
import sys
import threading
import time
from typing import Any

from volery.autonomy.search.calls import JOIN
from volery.autonomy.search.cooperative_search import CooperativeSearch
from volery.bridges.nodes.host import NodeHost
from volery.graph.connection import GraphConnection
from volery.graph.messages import Point, message_type, time_from_ns
from volery.graph.nodes.node import Node
from volery.graph.nodes.service_client import Future

CALLED, CALLING = "uav2", "uav1"
_PERIOD_S = 0.03
_LIMIT_S = 60.0


class Called(CooperativeSearch):
    """Responds as the search does, and with the handler's start time in the message."""

    def on_call(self, request: Any, response: Any) -> Any:
        """Records the start time of the handler."""
        began_ns = time.monotonic_ns()
        response = super().on_call(request, response)
        response.message = str(began_ns)
        return response


class Calling(Node):
    """Calls the teammate each 30 ms; `took` holds (one way, round trip), ns."""

    def __init__(self, **options: Any) -> None:
        super().__init__("calling", **options)
        self.took: list[tuple[int, int]] = []
        self.problem = ""
        self._client = self.create_client(JOIN, f"/{CALLED}/search/join")

    def call(self) -> None:
        """Calls the teammate once."""
        request = invitation()
        sent_ns = time.monotonic_ns()

        def on_answer(answer: Future) -> None:
            back_ns = time.monotonic_ns()
            if answer.exception() is not None:
                self.problem = str(answer.exception())
                return
            self.took.append((int(answer.result().message) - sent_ns, back_ns - sent_ns))

        self._client.call_async(request).add_done_callback(on_answer)


def invitation() -> Any:
    """Returns a call to a position beyond the area, which does not interrupt the search."""
    return message_type(f"{JOIN}_Request")(time_from_ns(1), CALLING, Point(-9.0, -9.0, 0.0))


def answer_calls(host: NodeHost, over: threading.Event) -> None:
    """Flies and responds until the input ends."""
    Called(
        context=host.context(),
        namespace=f"/{CALLED}",
        parameter_overrides={"team": [CALLING, CALLED], "gather_s": 1.0},
    )
    _say("ready")
    host.spin(over.is_set)


def make_calls(host: NodeHost, calls: int) -> None:
    """Makes calls one after the other, and prints their durations."""
    node = Calling(context=host.context(), namespace=f"/{CALLING}")
    end = time.monotonic() + _LIMIT_S
    while len(node.took) < calls and time.monotonic() < end:
        before = len(node.took)
        node.call()
        limit = time.monotonic() + 1.0
        host.spin(lambda before=before, limit=limit: _answered(node, before, limit))  # type: ignore[misc]
        time.sleep(_PERIOD_S)
    _say({"took": node.took, "problem": node.problem})


def _answered(node: Calling, before: int, limit: float) -> bool:
    return len(node.took) > before or bool(node.problem) or time.monotonic() > limit


def _wait_for_end(over: threading.Event) -> None:
    sys.stdin.read()
    over.set()


def _say(value: Any) -> None:
    sys.stdout.write(json.dumps(value) + "\n")
    sys.stdout.flush()


def _open_link(via: str, port: int, name: str) -> GraphConnection:
    if via == "rosbridge":
        from volery.bridges.rosbridge.client import RosbridgeClient

        return RosbridgeClient(f"ws://127.0.0.1:{port}", name=name)
    from volery.bridges.ros1.client import Ros1Client

    return Ros1Client(node_name=f"bench_{name}")


def main() -> None:
    """Runs the command line."""
    via, port, what, calls = sys.argv[1:]
    link = _open_link(via, int(port), what)
    host = NodeHost(link)
    if what == "calling":
        make_calls(host, int(calls))
    else:
        over = threading.Event()
        threading.Thread(target=_wait_for_end, args=(over,), daemon=True).start()
        answer_calls(host, over)
    link.close()


if __name__ == "__main__":
    main()
