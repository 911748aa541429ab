"""Adapters of the vectorized environments to training libraries."""
