"""Provides the ROS graph of the simulation: messages, topics, services, nodes, transforms."""
