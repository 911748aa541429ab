"""Provides the parts of a node, like rclpy's: logger, clock, timers, parameters, publishers."""

PYTHON_LOGGER = "volery.nodes"
"""Parent logger of all nodes in Python's `logging`."""
