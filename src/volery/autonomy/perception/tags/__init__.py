"""AprilTags in camera images: detection by OpenCV and poses (extra `vision`)."""
