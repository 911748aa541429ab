"""Native ROS 1 through rospy: the whole graph, or one node, in a real roscore."""
