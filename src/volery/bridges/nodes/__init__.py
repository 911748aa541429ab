"""Runs Volery's nodes in their own processes."""
