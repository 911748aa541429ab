"""ROS-TCP: the protocol of Unity's ROS-TCP-Connector and ROS-TCP-Endpoint, both sides."""
