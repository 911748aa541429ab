"""ROS 2 over DDS, as rmw_cyclonedds maps it."""
