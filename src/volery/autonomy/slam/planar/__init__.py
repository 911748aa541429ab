"""SLAM in the plane from scans of one level LIDAR, and odometry where there is any."""
