"""Materials of surfaces, as rays report them."""

from __future__ import annotations

from enum import IntEnum

import numpy as np


class Material(IntEnum):
    """Material number of a surface; it fits a uint8."""

    NONE = 0
    GROUND = 1
    WOOD = 2
    LEAF = 3
    UAV_BODY = 4
    ROTOR = 5
    WALL = 6
    BLOCK = 7
    CLOTHES = 8
    SKIN = 9
    CAR_PAINT = 10
    RUBBER = 11
    PLUMAGE = 12
    FACADE = 13
    """Outer wall with windows."""
    ROOF = 14
    ASPHALT = 15
    PAVING = 16
    METAL = 17
    PAINTED = 18
    """Paint in the colour of its solid."""


_DIFFUSE_REFLECTIVITY_905_NM = {
    Material.NONE: 0.0,
    Material.GROUND: 0.30,  # modelling choice: moist soil and litter
    Material.WOOD: 0.35,  # modelling choice: bark, between dark pine and light beech
    Material.LEAF: 0.50,  # modelling choice: green leaves on the near-infrared plateau
    Material.UAV_BODY: 0.15,  # modelling choice: dark plastic and carbon fibre
    Material.ROTOR: 0.05,  # modelling choice: black blades that fill a part of their disc
    Material.WALL: 0.60,  # modelling choice: light plaster
    Material.BLOCK: 0.50,  # modelling choice: matt red paint, bright in the near infrared
    Material.CLOTHES: 0.40,  # modelling choice: dyed cotton
    Material.SKIN: 0.55,  # modelling choice: skin beyond the absorption of haemoglobin
    Material.CAR_PAINT: 0.30,  # modelling choice: dark blue paint
    Material.RUBBER: 0.05,  # modelling choice: black tyres and tinted glass
    Material.PLUMAGE: 0.30,  # modelling choice: brown feathers
    Material.FACADE: 0.50,  # modelling choice: plaster, less its panes, which reflect away
    Material.ROOF: 0.25,  # modelling choice: painted sheet metal and bitumen
    Material.ASPHALT: 0.17,  # modelling choice: worn asphalt, between fresh (.1) and aged (.25)
    Material.PAVING: 0.35,  # modelling choice: granite setts and concrete slabs
    Material.METAL: 0.45,  # modelling choice: galvanized steel, dull
    Material.PAINTED: 0.50,  # modelling choice: light paint
}

REFLECTIVITY = np.array([_DIFFUSE_REFLECTIVITY_905_NM[material] for material in Material])
"""(materials,) fraction of near-infrared light that a surface reflects, by `Material`."""
REFLECTIVITY.flags.writeable = False
