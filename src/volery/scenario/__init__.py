"""Scenarios as data: the schema, the loader, the shipped scenarios."""
