"""The lock-step engine: one integer clock, a tuple of stages, everything deterministic."""
