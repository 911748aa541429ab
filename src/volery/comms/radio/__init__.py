"""The simulated radio of a run: the channel between UAVs, and the stations on the graph."""
