"""The middleware `rclpy`: runs Volery's nodes on the sourced ROS 2, with any rmw."""
