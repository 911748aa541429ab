"""MAVLink connections of the built-in autopilots: UDP, TCP and serial lines."""
