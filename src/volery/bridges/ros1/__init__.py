"""Native ROS 1 through rospy: connects the whole graph, or one node, to a real roscore."""
