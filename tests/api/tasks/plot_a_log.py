"""Draws the height of a UAV in a log."""

from volery.logs import open_log

log = open_log("flight.mcap")
log.plot("/uav1/odom", "pose.pose.position.z").figure.savefig("height.png")
