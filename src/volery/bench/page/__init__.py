"""The page in the browser: how fast it is, how honest, and what it costs the simulation."""
