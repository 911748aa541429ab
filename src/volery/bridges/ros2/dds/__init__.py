"""ROS 2 over DDS, with the mapping of rmw_cyclonedds."""
