"""Autonomy: nodes on the graph. They run unchanged in simulation and on real vehicles."""
