"""ROS 2 over zenoh, as rmw_zenoh maps it."""
