"""Encodings of messages (CDR, ROS 1, JSON) and the definitions of their types."""
