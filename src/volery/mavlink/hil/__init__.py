"""Real autopilots fly simulated UAVs in lock step: PX4 (HIL messages) and ArduPilot (JSON)."""
