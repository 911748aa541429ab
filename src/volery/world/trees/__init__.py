"""Procedural trees: species as data, grown into shared models at three levels of detail.

species.py    contents of species files        allometry.py  sizes from trunk diameter
branches.py   shoots and tubes                 foliage.py    leaves and simplified leaves
growth.py     common parts of all forms             broadleaf.py, conifers.py, palm.py, snag.py
models.py     from a species to tree models    model.py      shared tree models
"""

from volery.world.trees.model import BREAST_HEIGHT_M, DetailLevel, TreeMesh, TreeModel
from volery.world.trees.models import grow_model, grow_models
from volery.world.trees.species import Species, load_species, species_names

__all__ = [
    "BREAST_HEIGHT_M",
    "DetailLevel",
    "Species",
    "TreeMesh",
    "TreeModel",
    "grow_model",
    "grow_models",
    "load_species",
    "species_names",
]
