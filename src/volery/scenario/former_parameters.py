"""Former parameters of Volery's nodes, which recorded logs contain, with their present names."""

from __future__ import annotations

from collections.abc import Mapping

from volery.scenario.node_names import name_of_former_path

_TF = {"corrected": "use_map_tf"}
_RETURNS = {"reach_m": "max_range_m"}
_COLOUR_PATCH = {
    "saturation": "min_saturation",
    "value": "min_value",
    "share": "min_fraction",
    "object_m": "object_height_m",
}
FORMER_PARAMETERS: dict[str, dict[str, str]] = {
    "cooperative_search": {
        **_COLOUR_PATCH,
        "apart_m": "separation_m",
        "layer_m": "layer_spacing_m",
        "patience_s": "timeout_s",
        "search_s": "max_search_s",
    },
    "coverage": {
        "arrival_m": "acceptance_radius_m",
        "layer_m": "layer_spacing_m",
        "over_m": "crossing_height_m",
        "patience_s": "timeout_s",
    },
    "depth_avoidance": {"view_deg": "horizontal_fov_deg"},
    "exploration": {**_TF, "cell_m": "resolution_m", "view_m": "view_radius_m"},
    "global_planner": {
        **_TF,
        "cell_m": "resolution_m",
        "iterations": "max_iterations",
        "radius_m": "safe_radius_m",
    },
    "local_planner": {
        **_TF,
        "ahead_s": "start_delay_s",
        "arrival_m": "acceptance_radius_m",
        "cell_m": "resolution_m",
        "radius_m": "safe_radius_m",
        "unknown_stops": "avoid_unknown",
    },
    "mapping": {
        **_TF,
        **_RETURNS,
        "every": "beam_step",
        "grid_cell_m": "grid_resolution_m",
    },
    "planar_slam": {
        **_RETURNS,
        "nearest_m": "min_range_m",
        "odometry": "use_odometry",
        "start": "initial_pose",
    },
    "radio": {"planes_per_batch": "group_size", "station": "station_id"},
    "region_avoidance": {"far_m": "max_depth_m", "sidestep_m_s": "lateral_speed_m_s"},
    "slam": {**_RETURNS, "standing_height_m": "landed_height_m", "start": "initial_pose"},
    "target_detection": {
        **_TF,
        **_RETURNS,
        **_COLOUR_PATCH,
        "sightings": "min_observations",
        "spread_m": "max_sigma_m",
    },
    "task_manager": {
        **_TF,
        "alone_s": "team_timeout_s",
        "cell_m": "resolution_m",
        "enough": "coverage_fraction",
        "low_battery": "low_battery_fraction",
        "patience_s": "timeout_s",
        "search_s": "max_search_s",
        "sight_m": "view_radius_m",
        "stuck_s": "stuck_timeout_s",
    },
    "trajectory_follower": {"lead_s": "lookahead_s"},
}
"""Present names by former ones, by the node's registered name."""


def former_parameters(node: str) -> Mapping[str, str]:
    """Returns the renamed parameters of a node, given its name or its former path."""
    return FORMER_PARAMETERS.get(name_of_former_path(node), {})
