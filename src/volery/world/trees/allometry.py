"""Laws of height and crown width by trunk diameter, and distributions of diameters.

Diameters are at breast height in m; each law converts to the units of its source.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, ClassVar, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from volery.core.arrays import Array
from volery.core.quantities import Quantity
from volery.scenario.base import Bounded

Positive = Annotated[float, Field(gt=0.0, allow_inf_nan=False)]
Finite = Annotated[float, Field(allow_inf_nan=False)]

_M_PER_FOOT = 0.3048
_CM_PER_INCH = 2.54


_MIN_FRACTION = 1e-6
_EXPONENT = Quantity("", 20.0)


class Data(Bounded):
    """Base class of tables in a species file."""

    quantities: ClassVar[Mapping[str, Quantity]] = {
        **dict.fromkeys(("b", "p4", "c0", "c1", "c2", "e", "sigma_ln"), _EXPONENT),
        "taper": Quantity("", 20.0),
        "flare": Quantity("", 20.0),
        "cm": Quantity("cm", 1500.0, 0.1, {"mm": 0.1}),
    }


class MichaelisMentenHeight(Data):
    """Height a D^b / (k + D^b) in m for D in cm (generalised Michaelis-Menten)."""

    law: Literal["michaelis_menten"]
    a: Positive
    b: Positive
    k: Positive
    source: str

    def height(self, dbh: Array) -> Array:
        """Returns heights of trunks `dbh`, m."""
        power = (100.0 * dbh) ** self.b
        return np.asarray(self.a * power / (self.k + power))


class ChaveHeight(Data):
    """Height exp(c0 - e + c1 ln D + c2 (ln D)^2) in m for D in cm; `e` is the site's stress."""

    law: Literal["chave"]
    c0: Finite
    c1: Finite
    c2: Finite
    e: Finite
    source: str

    def height(self, dbh: Array) -> Array:
        """Returns heights of trunks `dbh`, m."""
        log = np.log(100.0 * dbh)
        return np.asarray(np.exp(self.c0 - self.e + self.c1 * log + self.c2 * log * log))


class CurtisArneyHeight(Data):
    """Height 4.5 + p2 exp(-p3 D^p4) in feet for D in inches (Forest Vegetation Simulator)."""

    law: Literal["curtis_arney"]
    p2: Positive
    p3: Positive
    p4: Annotated[float, Field(lt=0.0, allow_inf_nan=False)]
    source: str

    def height(self, dbh: Array) -> Array:
        """Returns heights of trunks `dbh`, m."""
        inches = 100.0 * dbh / _CM_PER_INCH
        return np.asarray(_M_PER_FOOT * (4.5 + self.p2 * np.exp(-self.p3 * inches**self.p4)))


class LinearHeight(Data):
    """Height h0 + h1 D in m for D in cm, at most `highest`."""

    law: Literal["linear"]
    h0: Positive
    h1: Positive
    highest: Positive
    source: str

    def height(self, dbh: Array) -> Array:
        """Returns heights of trunks `dbh`, m."""
        return np.minimum(self.h0 + self.h1 * 100.0 * dbh, self.highest)


HeightLaw = Annotated[
    MichaelisMentenHeight | ChaveHeight | CurtisArneyHeight | LinearHeight,
    Field(discriminator="law"),
]


class CrownWidth(Data):
    """Radius of the crown: from its area a D^b in m^2 for D in cm."""

    area_a: Positive
    area_b: Finite
    source: str

    def radius(self, dbh: float) -> float:
        """Returns the crown radius of a trunk `dbh`, m."""
        return float(np.sqrt(self.area_a * (100.0 * dbh) ** self.area_b / np.pi))


class DiameterSpread(Data):
    """Log-normal diameters, truncated at both ends (drawn by inversion, so every draw counts)."""

    median_cm: Positive
    sigma_ln: Positive
    smallest_cm: Positive
    largest_cm: Positive
    source: str

    @model_validator(mode="after")
    def _holds_some(self) -> Self:
        low, high = self._ends()
        if not high - low > _MIN_FRACTION:
            raise ValueError("this spread has no diameters from smallest_cm to largest_cm")
        return self

    def _ends(self) -> tuple[float, float]:
        """Returns fractions of the distribution below the smallest and the largest diameter."""
        from statistics import NormalDist

        normal = NormalDist(math.log(self.median_cm), self.sigma_ln)
        return normal.cdf(math.log(self.smallest_cm)), normal.cdf(math.log(self.largest_cm))

    def draw(self, rng: np.random.Generator, count: int) -> Array:
        """Returns `count` diameters, m."""
        from statistics import NormalDist

        normal = NormalDist(float(np.log(self.median_cm)), self.sigma_ln)
        low, high = self._ends()
        # the quantile function on a grid: one table serves all draws
        grid = np.log(np.geomspace(self.smallest_cm, self.largest_cm, 513))
        table = (np.array([normal.cdf(float(g)) for g in grid]) - low) / (high - low)
        return np.asarray(np.exp(np.interp(rng.random(count), table, grid)) / 100.0)
