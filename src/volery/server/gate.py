"""What a client of the page's rosbridge may do."""

from __future__ import annotations

from volery.bridges.rosbridge.wire import Operation
from volery.core.errors import BridgeError

_LOOKING = {"subscribe", "unsubscribe", "set_level", "status", "auth"}
"""Operations that change nothing for others."""
READ_ONLY_SERVICES = frozenset(
    {
        *(
            f"/rosapi/{name}"
            for name in (
                "topics",
                "topics_for_type",
                "topic_type",
                "topics_and_raw_types",
                "services",
                "services_for_type",
                "service_type",
                "service_providers",
                "service_node",
                "nodes",
                "node_details",
                "publishers",
                "subscribers",
                "message_details",
                "service_request_details",
                "service_response_details",
                "get_param",
                "has_param",
                "get_param_names",
                "get_time",
                "get_ros_version",
                "action_servers",
                "interfaces",
            )
        ),
        "/get_available_worlds",
        "/get_current_world",
        "/get_entities",
        "/get_entities_states",
        "/get_entity_bounds",
        "/get_entity_info",
        "/get_entity_state",
        "/get_named_pose_bounds",
        "/get_named_poses",
        "/get_simulation_state",
        "/get_simulator_features",
        "/get_spawnables",
        "/volery/get_grid_map",
        "/volery/get_weather",
        "/volery/list_snapshots",
    }
)
"""Services that change nothing; a new one joins this list, or is for pilots."""


class ViewerGate:
    """Lets a client look on."""

    def check(self, operation: Operation) -> None:
        """`BridgeError` for whatever changes something."""
        op = operation["op"]
        if op in _LOOKING:
            return
        name = str(operation.get("service", operation.get("topic", operation.get("action", ""))))
        if op == "call_service" and service_name(name) in READ_ONLY_SERVICES:
            return
        raise BridgeError(f"a viewer may not {op.replace('_', ' ')} {name}; show the pilots' token")


def service_name(called: str) -> str:
    """Name in the graph of what a client calls `/add` or, long ago, `/add#3`."""
    name = called.partition("#")[0]
    return name if name.startswith("/") else f"/{name}"
