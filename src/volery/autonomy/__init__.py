"""Autonomy: nodes on the graph. None of them knows whether it flies in a simulation."""
