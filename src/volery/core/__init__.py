"""Provides basics for all packages: errors, clock, frames, rotations, random streams, kernels."""
