"""The ROS graph inside the simulation: messages, topics, services, nodes, transforms."""
