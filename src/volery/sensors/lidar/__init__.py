"""LIDARs: models, beams, kernels and their bank."""
