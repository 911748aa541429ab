"""The radio inside a run: what gets through between UAVs, and the stations on the graph."""
