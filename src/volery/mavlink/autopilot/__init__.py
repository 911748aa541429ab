"""The built-in autopilot: MAVLink in and out by the rules of PX4; it opens no sockets."""
