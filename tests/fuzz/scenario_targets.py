"""Scenario files: shipped and made up, changed, loaded, built and flown."""

from __future__ import annotations

import tomllib
from functools import cache

from flight_check import refused_or_flown, refused_or_read
from scratch_files import path_of
from toml_mutation import changed_text, write

from volery.bridges.nodes.profile import load_profile
from volery.scenario import library
from volery.scenario.changes import apply, parse_changes
from volery.scenario.load import load_scenario

_HOVER = """
name = "hover"
seed = 3
duration_s = 5.0
[physics]
rate_hz = 500
on_contact = "bounce"
[world]
gnss_denied_areas = [{kind = "box", region_m = [50.0, 50.0, 60.0, 60.0]}]
[world.terrain]
kind = "flat"
extent_m = 200.0
[world.wind]
velocity_m_s = [3.0, 1.0, 0.0]
turbulence = "light"
gusts = [{amplitude_m_s = [2.0, 0.0, 0.0], start_s = 0.1, rise_s = 0.2, end_s = 1.0}]
[world.wind.profile]
kind = "log"
roughness_m = 0.1
[world.weather]
rain_mm_h = 2.0
[world.light]
hour_of_day = 11.5
[world.origin]
latitude_deg = 47.4
longitude_deg = 8.5
altitude_m = 488.0
[[world.actors]]
name = "bird"
shape = "bird"
motion = {kind = "circle", centre_m = [20.0, 0.0, 8.0], radius_m = 5.0, speed_m_s = 4.0}
[[world.actors]]
name = "car"
shape = "car"
motion = {kind = "waypoints", waypoints_m = [[30.0, 0.0], [30.0, 20.0]], speed_m_s = 5.0}
[[world.actors]]
name = "pad"
shape = "tag"
tag = {id = 7, size_m = 0.5}
motion = {kind = "attached", actor = "car", position_m = [-0.4, 0.0, 1.45], yaw_deg = 10.0}
[types.f450]
airframe = "f450"
battery_charge = 0.9
wear = [{thrust = 0.95, torque = 1.1, lag = 1.2}, {}, {}, {}]
flight = {take_off_altitude_m = 2.5, return_altitude_m = 8.0, command_timeout_s = 0.5}
sensors = [
  {kind = "imu", rate_hz = 100.0},
  {kind = "gnss", position_m = [0.0, 0.0, 0.1]},
  {kind = "barometer"},
  {kind = "magnetometer"},
  {kind = "estimate", used_for_control = true},
  {kind = "sonar", position_m = [0.0, 0.0, -0.05], rpy_deg = [0.0, 90.0, 0.0]},
  {kind = "battery", rate_hz = 5.0},
  {kind = "ground_truth"},
]
[[uavs]]
type = "f450"
count = 2
position_m = [0.0, 0.0]
last_position_m = [5.0, 0.0]
yaw_deg = 30.0
on_start = "take_off"
"""
_LOOPS = """
name = "loops"
duration_s = 5.0
[types.loops]
airframe = "f450"
plant = "identified"
sensors = [{kind = "odometry"}, {kind = "imu"}]
[types.moved]
airframe = "iris"
plant = "kinematic"
kinematic = {time_constant_s = 0.2, limited = true}
sensors = [{kind = "lidar", nodding = {amplitude_deg = 30.0, period_s = 1.0}}]
[[uavs]]
type = "loops"
position_m = [0.0, 0.0, 5.0]
[[uavs]]
type = "moved"
position_m = [10.0, 0.0, 5.0]
"""
_COURSE = """
name = "course"
duration_s = 5.0
[radio]
frequency_mhz = 2437.0
power_dbm = 20.0
bandwidth_mhz = 20.0
bit_rate_mbit_s = 6.0
queue_s = 0.2
topics = [{name = "team", type = "std_msgs/msg/String"}]
[world.forest]
kind = "procedural"
region_m = [10.0, -20.0, 40.0, 20.0]
trees = 12
minimum_spacing_m = 4.0
species = {broadleaf = 1.0}
[types.surveyor]
airframe = "f450"
sensors = [
  {kind = "lidar", name = "horizontal", position_m = [0.0, 0.0, 0.18]},
  {kind = "lidar", name = "nodding", position_m = [0.1, 0.0, -0.08], nodding = {period_s = 2.0}},
  {kind = "odometry"},
  {kind = "sonar", position_m = [0.0, 0.0, -0.05], rpy_deg = [0.0, 90.0, 0.0]},
]
[[types.surveyor.nodes]]
node = "gap_following"
parameters = {route = [[30.0, 0.0]], height_m = 3.0, level_mount = [0.0, 0.0, 0.18]}
[[uavs]]
type = "surveyor"
position_m = [0.0, 0.0]
[[nodes]]
node = "coverage"
parameters = {uavs = ["uav1"], height_m = 2.5, layer_spacing_m = 1.5, timeout_s = 10.0}
[[faults]]
kind = "motor"
uav = "uav1"
rotor = 0
thrust_factor = 0.9
at_s = 0.2
"""
_PROFILE = """
name = "flight_test"
via = "ros1"
namespace = "/uav1"
clock = "wall"
remap = {"laser/horizontal/scan" = "/scan", "odom" = "/mavros/odom"}
parameters = {height_m = 3.0, route = [[1.0, 2.0]]}
launch = [{node = "gap_following", parameters = {height_m = 3.0}}]
"""
_CHANGES = {
    "uavs": 3,
    "airframe": "iris",
    "sensors": ["sonar"],
    "seed": 4,
    "seconds": 10.0,
    "speed": 1.0,
    "tree_density_per_ha": 100.0,
}


@cache
def _shipped():
    return [library.path_of(name).read_text(encoding="utf-8") for name in library.names()]


def flights(mutator):
    """Small scenarios, flown for a moment."""
    path = path_of("scenario.toml")
    write(path, changed_text(mutator, mutator.pick((_HOVER, _LOOPS, _COURSE))))
    refused_or_flown(lambda: load_scenario(path))
    return 1


def files(mutator):
    """Shipped scenarios, loaded alone: most are too large to build one after the other."""
    path = path_of("scenario.toml")
    write(path, changed_text(mutator, mutator.pick(_shipped())))
    refused_or_read(lambda: load_scenario(path))
    return 1


def changes(mutator):
    """What a client may have otherwise in a scenario."""
    text = _json_of(mutator.changed(_CHANGES))
    path = path_of("scenario.toml")
    write(path, mutator.pick((_HOVER, _COURSE)))
    refused_or_read(lambda: apply(load_scenario(path), parse_changes(text)))
    return 1


def profiles(mutator):
    """Launch profiles."""
    path = path_of("profile.toml")
    write(path, changed_text(mutator, _PROFILE))
    refused_or_read(lambda: load_profile(path))
    return 1


def _json_of(data):
    import json

    return json.dumps(data, default=str)


for _text in (_HOVER, _LOOPS, _COURSE, _PROFILE):
    tomllib.loads(_text)
