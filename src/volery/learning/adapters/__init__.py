"""Adapters of tasks to trainers that do not take a `gymnasium.vector.VectorEnv`."""
