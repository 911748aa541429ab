"""Flying to a goal through what is known and what is seen.

`exploration_node` chooses goals, `global_planner` a way through the map, `local_planner` what is
flown in the next seconds, `follower` flies it.
"""
