"""Statistics of LIDARs in rain, snow, fog and dust against the formulas, integrated by scipy.

What is expected uses nothing of the code under test but the numbers of the model file:
`Expected` writes the formulas of `docs/weather.md` out once more.
"""

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from scipy import integrate, optimize, stats

sys.path.insert(0, str(Path(__file__).parent.parent / "unit" / "sensors"))

from scanning import echoes_of, solids
from scene_samples import cylinder

from volery.sensors.lidar.lidar_model import load_lidar
from volery.sensors.lidar.particle_echoes import particle_table
from volery.world.weather import Particles

SCANS = 60
RAIN, SNOW = Particles(rain_mm_h=20.0), Particles(snow_mm_h=2.0)
FOG, DUST = Particles(fog_visibility_m=60.0), Particles(dust_visibility_m=40.0)
WEATHERS = pytest.mark.parametrize(
    "particles", [RAIN, SNOW, FOG, DUST], ids=["rain", "snow", "fog", "dust"]
)


def extinction(p):
    """1/m at 905 nm; the fogs here are dense, so that their colour is none."""
    rain = 0.3647e-3 * p.rain_mm_h**0.63
    snow = (5.42e-5 * 905 + 5.4958776) * p.snow_mm_h**1.38 / 4342.945
    return rain + snow + 2.995732 / p.fog_visibility_m + 2.995732 / p.dust_visibility_m


@dataclass
class Expected:
    """The formulas, for one LIDAR in one kind of particles."""

    model: object
    particles: Particles

    def __post_init__(self):
        m, p = self.model, self.particles
        self.a, self.far = extinction(p), m.range.max_m
        self.max_range_m = optimize.brentq(
            lambda r: r * np.exp(self.a * r) - self.far, 1e-6, self.far
        )
        self.length = m.mixed_pixels.pulse_length_m

    def mean(self, r):
        """Strength of a pulse length of fog or dust."""
        p = self.particles
        beta = 0.046 / p.fog_visibility_m + 2.995732 / p.dust_visibility_m / 55.0
        weak = np.exp(-2 * self.a * r) / 0.9
        return np.pi * beta * self.length * weak * (self.far / (r + 1.0)) ** 2

    def min_diameter_mm(self, r):
        """Diameter of the smallest grain that is noticed, mm."""
        front = (0.328 / 2.328) ** 2
        back = front * (1 - front) ** 2 * (1.328 / 0.672) ** 2
        b = (front + back) / 16 if self.particles.rain_mm_h else np.pi / 2 / 30
        width = 1e3 * (0.005 + self.model.mixed_pixels.divergence_rad * r)
        return width * np.sqrt(0.9 / 4 / b) * (r + 1.0) * np.exp(self.a * r) / self.far

    @property
    def slope(self):
        p = self.particles
        if p.rain_mm_h:
            return 4.1 * p.rain_mm_h**-0.21
        return 2.55 / 10 ** (1 / 3) * p.snow_mm_h**-0.48

    def rate(self, r):
        """Noticed false echoes a metre."""
        if self.particles.rain_mm_h or self.particles.snow_mm_h:
            number = self.a * 1e6 * self.slope**3 / np.pi
            area = np.pi / 4 * (0.005 + self.model.mixed_pixels.divergence_rad * r) ** 2
            return area * number / self.slope * np.exp(-self.slope * self.min_diameter_mm(r))
        return np.exp(-1 / self.mean(r)) / self.length

    def events(self, r):
        """Mean number before range r."""
        return integrate.quad(self.rate, self.model.range.min_m, r, limit=200)[0]

    def noticed_fraction(self, r, behind):
        """Fraction of the echoes from r that are noticed before a surface of strength `behind`."""
        fraction = self.model.mixed_pixels.first_echo_share
        min_strength = fraction / (1 - fraction) * behind
        if min_strength <= 1:
            return 1.0
        if self.particles.rain_mm_h or self.particles.snow_mm_h:
            return np.exp(-self.slope * self.min_diameter_mm(r) * (np.sqrt(min_strength) - 1))
        return np.exp(-(min_strength - 1) / self.mean(r))


SURE = {
    "noise": {"floor_m": 0.0, "slope": 0.0, "offset_m": 0.0},
    "range": {"resolution_m": 1e-6},
    "dropout": {"far": 0.0, "grazing": 0.0},
}
"""What blurs the statistics, left out."""


def first_noticed():
    """A scanner that reports the first of two echoes."""
    return load_lidar("utm_30lx").changed(**SURE)


def strongest():
    """One of longer range that reports the strongest."""
    mixed = {"divergence_rad": 3e-3, "pulse_length_m": 0.9, "first_echo_share": 0.5}
    ranges = {"min_m": 0.5, "max_m": 100.0, "resolution_m": 1e-6}
    return load_lidar("utm_30lx").changed(**{**SURE, "mixed_pixels": mixed, "range": ranges})


KINDS = pytest.mark.parametrize("make", [first_noticed, strongest])


def measured(model, particles, surface=None, **options):
    """Ranges (beams of all scans,) of the first echoes; in the open, or before a round wall."""
    around = cylinder(surface or 2.0 * model.range.max_m, 4.0, 4000, z=-2.0)
    scene = solids(around)
    air = particle_table(model, particles)
    echoes = echoes_of(scene, model, scans=SCANS, air=air, **options)
    scene.close()
    return echoes


@KINDS
@WEATHERS
def test_false_echoes_in_the_open(make, particles):
    """Their fraction, and the distribution of their ranges, against the Poisson process."""
    model = make()
    expected = Expected(model, particles)
    ranges = measured(model, particles).ranges.astype(float).ravel()
    seen = ranges[np.isfinite(ranges)]
    fraction = 1.0 - np.exp(-expected.events(expected.max_range_m))
    assert len(seen) / len(ranges) == pytest.approx(
        fraction, abs=4.0 * np.sqrt(fraction * (1 - fraction) / len(ranges)) + 1e-6
    )
    if len(seen) < 100:
        assert fraction < 0.005  # too few for a distribution
        return
    grid = np.linspace(model.range.min_m, expected.max_range_m, 300)
    below = np.interp(seen, grid, [1.0 - np.exp(-expected.events(r)) for r in grid]) / fraction
    assert stats.kstest(below, "uniform").pvalue > 1e-3


@KINDS
@WEATHERS
def test_false_echoes_before_a_wall(make, particles):
    """Fraction of beams whose wall is hidden by a false echo."""
    model, distance = make(), 6.0
    expected = Expected(model, particles)
    ranges = measured(model, particles, distance).ranges.astype(float).ravel()
    behind = (model.range.max_m / distance) ** 2 * np.exp(-2 * expected.a * distance)

    def hides(r):
        first = expected.rate(r) * np.exp(-expected.events(r))
        return first * expected.noticed_fraction(r, behind)

    before = distance - expected.length
    fraction = integrate.quad(hides, model.range.min_m, before, limit=100, epsrel=1e-4)[0]
    found = (ranges < before + 0.01).mean()
    assert found == pytest.approx(
        fraction, abs=4.0 * np.sqrt(fraction * (1 - fraction) / len(ranges)) + 1e-5
    )
    np.testing.assert_allclose(ranges[ranges > before + 0.01], distance, atol=1e-3)


@WEATHERS
def test_range_shrinks_to_where_the_echo_is_as_weak_as_at_full_range(particles):
    model = first_noticed().without_noise()
    max_range_m = Expected(model, particles).max_range_m
    assert max_range_m < 0.95 * model.range.max_m
    assert np.isfinite(measured(model, particles, 0.998 * max_range_m).ranges).all()
    assert np.isinf(measured(model, particles, 1.002 * max_range_m).ranges).all()


@pytest.mark.parametrize("distance", [8.0, 12.0, 16.0])
def test_dropouts_over_the_range(distance):
    """Those of clear air at the range at which the echo would be as weak."""
    model = first_noticed().changed(dropout={"far": 0.5, "grazing": 0.0}, particles=BLIND)
    particles = Particles(fog_visibility_m=100.0)
    alike = distance * np.exp(extinction(particles) * distance) / model.range.max_m
    ranges = measured(model, particles, distance).ranges
    fraction = 0.5 * alike**2
    assert np.isinf(ranges).mean() == pytest.approx(
        fraction, abs=4.0 * np.sqrt(fraction * (1 - fraction) / ranges.size)
    )


BLIND = {"overlap_m": 1e6}
"""No particle is noticed."""


@pytest.mark.parametrize("name", ["utm_30lx", "vlp_16"])
def test_intensities_weaken_by_beer_and_lambert(name):
    model = load_lidar(name).changed(**{**SURE, "intensity": {"noise": 0.0}, "particles": BLIND})
    scene = solids(cylinder(7.0, 100.0, 2000, z=-50.0))
    clear = echoes_of(scene, model, intensities=True)
    particles = Particles(fog_visibility_m=150.0, rain_mm_h=10.0)
    hazy = echoes_of(scene, model, intensities=True, air=particle_table(model, particles))
    scene.close()
    a = extinction(particles)
    seen = np.isfinite(hazy.ranges)
    assert seen.mean() > 0.9
    weaker = hazy.intensities[seen] / clear.intensities[seen]
    np.testing.assert_allclose(weaker, np.exp(-2 * a * hazy.ranges[seen].astype(float)), rtol=1e-4)


def test_a_false_echo_shines_as_a_surface_of_its_strength():
    """The weakest that are noticed are as bright as the threshold's surface, its loss aside."""
    model = strongest().changed(intensity={"range_exponent": 2.0, "maximum": 1e9, "noise": 0.0})
    echoes = measured(model, FOG, intensities=True)
    ranges, shine = echoes.ranges.astype(float), echoes.intensities
    near = model.intensity.reference_range_m
    seen = np.isfinite(ranges) & (ranges > near)
    threshold = model.intensity.scale * 0.9 * (near / model.range.max_m) ** 2
    strength = shine[seen] / threshold
    assert strength.min() == pytest.approx(1.0, abs=0.02)
    # an exponential distribution has its mean for a spread above the threshold
    mean = Expected(model, FOG).mean(ranges[seen])
    assert ((strength - 1.0) / mean).mean() == pytest.approx(1.0, abs=0.03)


def test_several_echoes_hold_the_false_one_and_the_wall():
    model = load_lidar("utm_30lx_ew").changed(**SURE)
    echoes = measured(model, FOG, 5.0).ranges
    false = echoes[:, 0] < 3.4
    assert 0.05 < false.mean() < 0.95
    np.testing.assert_allclose(echoes[:, 1][false], 5.0, atol=1e-3)
    np.testing.assert_allclose(echoes[:, 0][~false], 5.0, atol=1e-3)
    assert (np.diff(np.where(np.isinf(echoes), 1e9, echoes), axis=1) >= 0.0).all()


def test_scans_do_not_depend_on_their_batch_or_threads():
    model = load_lidar("vlp_16")
    air = particle_table(model, Particles(rain_mm_h=50.0, snow_mm_h=1.0, fog_visibility_m=80.0))
    scene = solids(cylinder(20.0, 40.0, 500, z=-20.0), threads=2)
    together = echoes_of(scene, model, scans=4, air=air, intensities=True)
    for k in range(4):
        alone = echoes_of(scene, model, number=k, air=air, intensities=True)
        np.testing.assert_array_equal(alone.ranges[0], together.ranges[k])
        np.testing.assert_array_equal(alone.intensities[0], together.intensities[k])
    clear = echoes_of(scene, model, scans=4)
    kept = np.isfinite(together.ranges) & (together.ranges > 19.5)
    np.testing.assert_array_equal(together.ranges[kept], clear.ranges[kept])
    scene.close()
