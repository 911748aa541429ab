"""Training of policies; needs `pip install "volery[train]"`."""
