"""Scenarios made of uploaded files."""
