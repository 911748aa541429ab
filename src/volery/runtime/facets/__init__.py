"""The facets of a `Simulation`: its clock, vehicles, world, faults and diagnostics."""
