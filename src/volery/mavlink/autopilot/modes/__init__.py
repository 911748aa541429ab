"""Flight modes of the autopilot, and the flights of each."""
