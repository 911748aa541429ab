"""State estimation: an error-state Kalman filter for every UAV of a fleet."""
