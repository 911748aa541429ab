"""What a node consists of: logger, clock, timers, parameters, publishers; in rclpy's shape."""

PYTHON_LOGGER = "volery.nodes"
"""Logger of Python's `logging` above those of all nodes."""
