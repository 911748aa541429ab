"""Nodes that avoid obstacles without a map: by gaps, by regions, by depth images."""
