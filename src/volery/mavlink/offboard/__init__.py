"""The other end of offboard control: a program that flies an autopilot by MAVLink setpoints.

Belongs here: the connection that gives a node of this program the topics of a UAV over MAVLink.
"""
