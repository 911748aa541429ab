"""Environments for reinforcement learning, over the vectorized simulation.

Belongs here: tasks as data, the terms that they are made of, and the interface of Gymnasium. Needs
`pip install "volery[learning]"`.
"""

from volery.core.errors import VoleryError
from volery.core.extras import missing_package

try:
    import gymnasium  # noqa: F401  (each module needs it)
except ImportError:
    raise VoleryError(missing_package("volery.learning", "gymnasium", "learning")) from None
