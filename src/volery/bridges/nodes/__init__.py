"""Nodes of this project in processes of their own."""
