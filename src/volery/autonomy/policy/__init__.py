"""Trained policies: their files, their networks and the node that flies them.

Belongs here: what a policy observes and commands as pure functions over arrays, which the
environments of `volery.learning` share, and the node that computes the same from messages.
"""
