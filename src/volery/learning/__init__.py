"""Environments for reinforcement learning, over the vectorized simulation.

Belongs here: tasks as data, the terms that they are made of, and the interfaces of Gymnasium and
PettingZoo. Needs `pip install "volery[learning]"`.
"""
