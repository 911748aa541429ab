"""One simulation on several machines: a leader, and workers that serve some of its UAVs.

Every machine computes the dynamics of all UAVs, which is cheap; the LIDARs, cameras and nodes of a
UAV exist on one machine (`runtime.construction.partition`). At barriers the machines exchange what
their nodes have published and what the leader's clients have commanded, so that all compute the
same states, to the byte: `leader` and `worker` are the two ends, `exchange` is what they share.
docs/divided_runs.md explains it.
"""
