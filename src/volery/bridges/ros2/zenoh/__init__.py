"""ROS 2 over zenoh, with the mapping of rmw_zenoh."""
