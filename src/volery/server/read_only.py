"""Services that change nothing: viewers may call them, and they command no UAV.

Add a new service to this list if viewers may call it; else only operators may.
"""

from __future__ import annotations

_ROSAPI = (
    "action_servers",
    "action_type",
    "get_param",
    "get_param_names",
    "get_ros_version",
    "get_time",
    "has_param",
    "interfaces",
    "message_details",
    "node_details",
    "nodes",
    "publishers",
    "service_node",
    "service_providers",
    "service_request_details",
    "service_response_details",
    "service_type",
    "services",
    "services_for_type",
    "subscribers",
    "topic_type",
    "topics",
    "topics_and_raw_types",
    "topics_for_type",
)
READ_ONLY_SERVICES = frozenset(
    {
        *(f"/rosapi/{name}" for name in _ROSAPI),
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
        "/volery/get_scenario_options",
        "/volery/get_grid_map",
        "/volery/get_weather",
        "/volery/list_snapshots",
        "/volery/player/info",
    }
)
