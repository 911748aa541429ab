"""The middleware `rclpy`: nodes of ours on the ROS 2 that is sourced, whichever rmw that uses."""
