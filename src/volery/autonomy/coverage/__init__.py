"""Coverage of a grid map by several UAVs: areas of equal size, and a closed tour of each.

`plan.plan_coverage` is the whole method; the node `planner_node.CoveragePlanner` runs it.
"""
