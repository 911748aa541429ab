"""Simultaneous localization and mapping: an inertial filter corrected by LIDAR scan matching."""
