"""Environments for reinforcement learning, over the vectorized simulation.

Belongs here: tasks as data, the terms that they are made of, and the interface of Gymnasium. Needs
`pip install "volery[learning]"`.
"""

from volery.core.extras import import_extra

import_extra("volery.learning", "gymnasium", "gymnasium", "learning")  # each module needs it
