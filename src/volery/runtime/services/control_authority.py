"""Creates the services by which operators take and hand over control authority."""

from __future__ import annotations

from typing import Any

from volery.graph.graph import Graph
from volery.runtime.services.results import Fields, offer_command
from volery.runtime.vehicles.control_authority import ControlAuthority

_OURS = "volery_interfaces/srv"
TAKE, RELEASE, HAND_OVER = (
    "/volery/take_control",
    "/volery/release_control",
    "/volery/hand_over",
)


def offer_piloting(graph: Graph, operators: ControlAuthority) -> None:
    """Creates the services to take, release and hand over control; see `ControlAuthority`."""

    def take(request: Any) -> Fields:
        operators.take(request.uav, request.operator)
        return {"message": f"{request.operator} steers {request.uav}"}

    def release(request: Any) -> Fields:
        operators.release(request.uav, request.operator)
        return {"message": f"{request.operator} steers {request.uav or 'nothing'} no more"}

    def hand_over(request: Any) -> Fields:
        operators.hand_over(request.uav, request.operator, request.to)
        return {"message": f"{request.to} steers {request.uav}"}

    offer_command(graph, TAKE, f"{_OURS}/TakeControl", take)
    offer_command(graph, RELEASE, f"{_OURS}/ReleaseControl", release)
    offer_command(graph, HAND_OVER, f"{_OURS}/HandOver", hand_over)
