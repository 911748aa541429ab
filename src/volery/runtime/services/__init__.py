"""Creates the services on the graph that control the simulation and its UAVs."""
