"""Swarms: formations planned online.

Belongs here: what plans for many UAVs at once, as kernels over arrays, and the nodes around them.
"""
