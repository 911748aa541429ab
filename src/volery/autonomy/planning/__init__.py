"""Planning and flying to a goal, from the map and from current sensor data.

`exploration_node` chooses goals, `global_planner` plans a path through the map, `local_planner`
plans the trajectory of the next seconds, `trajectory_follower` flies it.
"""
