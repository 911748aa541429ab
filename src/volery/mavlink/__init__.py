"""MAVLink: an autopilot for every UAV that ground stations understand, and real ones in lock step.

The autopilot (`autopilot.Autopilot`) takes frames and flight states with their simulated time and
gives frames and commands to its UAV: it knows neither sockets nor graphs. `node.Autopilot` runs it
inside the simulation, `udp_bridge`, `tcp_bridge` and `serial_bridge` carry its
frames.
"""
