"""ROS-TCP: what Unity's ROS-TCP-Connector and ROS-TCP-Endpoint speak, from both sides."""
