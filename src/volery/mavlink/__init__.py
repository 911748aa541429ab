"""MAVLink: a built-in autopilot for every UAV, and real autopilots in lock step.

The built-in autopilot (`autopilot.Autopilot`) receives frames and flight states with their
simulated time and returns frames and commands to its UAV; it uses neither sockets nor graphs.
`node.AutopilotNode` runs it inside the simulation; `udp_bridge`, `tcp_bridge` and `serial_bridge`
carry its frames.
"""
