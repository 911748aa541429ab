"""Every parser of bytes from outside, by name, and what is built and flown of files.

A target takes a `Mutator`, feeds its parser, checks what must hold and returns how many frames that
were. What it must not let out: any exception but those that its parser documents.
"""

import city_targets
import comms_targets
import damaged_log_targets
import data_file_targets
import grid_map_targets
import log_targets
import mavlink_targets
import mesh_targets
import message_targets
import policy_targets
import ros2_targets
import rosbridge_targets
import scenario_targets
import socket_targets

TARGETS = {
    "ros_tcp_wire": socket_targets.ros_tcp_wire,
    "ros_tcp_endpoint": socket_targets.ros_tcp_endpoint,
    "ros_tcp_connector": socket_targets.ros_tcp_connector,
    "rosbridge_json": rosbridge_targets.json_frames,
    "rosbridge_cbor": rosbridge_targets.cbor_frames,
    "rosbridge_budgets": rosbridge_targets.budgets,
    "rosbridge_png": rosbridge_targets.images,
    "rosbridge_fragments": rosbridge_targets.fragments,
    "rosbridge_server": rosbridge_targets.server,
    "rosbridge_client": rosbridge_targets.client,
    "sensor_link_wire": socket_targets.sensor_link_wire,
    "sensor_link_payloads": socket_targets.sensor_link_payloads,
    "sensor_link_commands": socket_targets.sensor_link_commands,
    "comms_wire": comms_targets.wire,
    "comms_router": comms_targets.router,
    "mavlink_wire": mavlink_targets.wire,
    "mavlink_autopilot": mavlink_targets.autopilot,
    "cdr": message_targets.cdr,
    "ros1": message_targets.ros1,
    "object_counts": message_targets.object_counts,
    "plain_values": message_targets.plain_values,
    "definitions": message_targets.definitions,
    "topic_patterns": message_targets.patterns,
    "name_filters": message_targets.filters,
    "type_names": message_targets.type_names,
    "ros2_tokens": ros2_targets.tokens,
    "ros2_attachments": ros2_targets.attachments,
    "mcap": log_targets.mcap,
    "bag": log_targets.bag,
    "ulog": log_targets.ulog,
    "damaged_mcap": damaged_log_targets.damaged_mcap,
    "damaged_bag": damaged_log_targets.damaged_bag,
    "damaged_db3": damaged_log_targets.damaged_db3,
    "policy_archives": policy_targets.archives,
    "policy_contents": policy_targets.contents,
    "grid_map_matrix": grid_map_targets.matrix,
    "grid_map_moving_ai": grid_map_targets.moving_ai,
    "grid_map_image": grid_map_targets.image,
    "grid_map_message": grid_map_targets.occupancy,
    "city_outlines": city_targets.outlines,
    "mesh_glb": mesh_targets.glb,
    "mesh_gltf": mesh_targets.gltf,
    "mesh_obj": mesh_targets.obj,
    "mesh_stl": mesh_targets.stl,
    "scenario_flights": scenario_targets.flights,
    "scenario_files": scenario_targets.files,
    "scenario_changes": scenario_targets.changes,
    "launch_profiles": scenario_targets.profiles,
    "airframes": data_file_targets.airframes,
    "identified_models": data_file_targets.identified_models,
    "sensor_models": data_file_targets.sensor_models,
    "based_files": data_file_targets.based_files,
    "beam_tables": data_file_targets.beam_tables,
    "wind_tables": data_file_targets.wind_tables,
    "tree_tables": data_file_targets.tree_tables,
    "height_tables": data_file_targets.height_tables,
    "tree_species": data_file_targets.species_files,
}
BUILT = (
    "scenario_flights",
    "airframes",
    "identified_models",
    "sensor_models",
    "beam_tables",
    "wind_tables",
    "tree_tables",
    "height_tables",
)
"""Those that build simulations and fly them: some tenths of a second a check."""
LOADED = ("scenario_files", "scenario_changes", "launch_profiles", "tree_species", "based_files")
"""Those that load files of schemas: some milliseconds a check."""
