"""Scenarios made of files that visitors of the page bring."""
