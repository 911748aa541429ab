"""The SLAM over a recorded log: what it hears, what it says, and the map that follows."""
