"""Planar SLAM from scans of one horizontal LIDAR, with odometry if available."""
