"""Runs the SLAM over a recorded log: inputs, node, trajectory and map."""
