"""The built-in autopilot: receives and sends MAVLink by the rules of PX4; opens no sockets."""
