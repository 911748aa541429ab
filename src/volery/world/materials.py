"""What a surface is made of, as a ray reports it."""

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
}

REFLECTIVITY = np.array([_DIFFUSE_REFLECTIVITY_905_NM[material] for material in Material])
"""(materials,) share of near-infrared light that a surface scatters back, by `Material`."""
REFLECTIVITY.flags.writeable = False
