"""Words everyone uses: errors, clock, frames, rotations, random streams, compiled kernels."""
