"""Detections of AprilTags in environments: by geometry, or in rendered images."""
