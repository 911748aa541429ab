"""Compiles the kernels of swarms; see `volery.autonomy.perception.warmup`."""

from __future__ import annotations

import numpy as np

from volery.autonomy.swarm.ares import AresSearch, AresSettings
from volery.autonomy.swarm.behaviour import Surroundings, flock_within
from volery.autonomy.swarm.formation_fitness import formation_fitness
from volery.autonomy.swarm.olfati_saber import OlfatiSaber
from volery.autonomy.swarm.particle_swarm import approach_margin
from volery.autonomy.swarm.vasarhelyi import Vasarhelyi


def formation_search() -> None:
    """Compiles the search of a plan, and the fitness of a formation."""
    positions = np.array([[0.0, 0.0], [2.0, 1.0], [4.0, 0.0]])
    velocities = np.full((3, 2), 0.5)
    formation_fitness(positions, velocities)
    search = AresSearch(positions, velocities, settings=AresSettings(num_clones=1))
    search.advance()
    flock = np.zeros((4, 3))
    approach_margin(flock, flock, 1.0)


def flocking() -> None:
    """Compiles the behaviours of flocks."""
    position, velocity = np.array([[0.0, 0.0], [2.0, 1.0]]), np.zeros((2, 2))
    around = Surroundings(cylinders=np.array([[5.0, 5.0, 0.3]]))
    for behaviour in (Vasarhelyi(), OlfatiSaber()):
        flock = flock_within(position, velocity, behaviour.radius_m)
        behaviour.velocities(flock, velocity, around)
