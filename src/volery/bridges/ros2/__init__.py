"""Native ROS 2, over DDS or zenoh, without an installed ROS 2."""
