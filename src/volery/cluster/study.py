"""The study: frozen data that defines many runs of one scenario, validated on construction.

A TOML file maps onto `Study` one to one; docs/sweeps.md explains it.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal, Self

from pydantic import Field, model_validator

from volery.scenario.base import Bounded

_Name = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]*$", max_length=60)]
_Count = Annotated[int, Field(ge=1, le=1_000_000)]
_Seed = Annotated[int, Field(ge=0, lt=2**63)]
_Fraction = Annotated[float, Field(gt=0.0, lt=1.0)]


class StudyParameter(Bounded):
    """A parameter of the scenario: its key, and its values or the distribution of them."""

    key: Annotated[str, Field(min_length=1)]
    """Path of keys in the scenario, such as `world.wind.velocity_m_s[0]`, or a short form."""
    values: Annotated[tuple[Any, ...], Field(min_length=1)] | None = None
    """Values in the order of the report."""
    range: tuple[float, float] | None = None
    """First and last of `steps` evenly spaced values."""
    steps: Annotated[int, Field(ge=2, le=100_000)] | None = None
    """Number of values in `range`."""
    distribution: Literal["uniform", "loguniform", "normal"] | None = None
    """Distribution of random values; see `Study.sampling`."""
    low: float | None = None
    """Lower bound of `uniform` and `loguniform`."""
    high: float | None = None
    """Upper bound of `uniform` and `loguniform`."""
    mean: float | None = None
    """Mean of `normal`."""
    std: Annotated[float, Field(gt=0.0)] | None = None
    """Standard deviation of `normal`."""

    @model_validator(mode="after")
    def _has_one_source(self) -> Self:
        sources = [self.values, self.range, self.distribution]
        if sum(source is not None for source in sources) != 1:
            raise ValueError("give one of 'values', 'range' with 'steps', or 'distribution'")
        if (self.range is None) != (self.steps is None):
            raise ValueError("'range' and 'steps' belong together")
        wanted = {
            None: (),
            "uniform": ("low", "high"),
            "loguniform": ("low", "high"),
            "normal": ("mean", "std"),
        }[self.distribution]
        for name in ("low", "high", "mean", "std"):
            if (getattr(self, name) is not None) != (name in wanted):
                verb = "needs" if name in wanted else "has no"
                raise ValueError(f"distribution {self.distribution} {verb} '{name}'")
        if self.low is not None and self.high is not None and not self.low < self.high:
            raise ValueError(f"low = {self.low:g} must be below high = {self.high:g}")
        if self.distribution == "loguniform" and self.low is not None and self.low <= 0.0:
            raise ValueError(f"low = {self.low:g} of a loguniform distribution must be above 0")
        return self

    @property
    def is_random(self) -> bool:
        """Whether values are drawn from a distribution."""
        return self.distribution is not None


class StudySampling(Bounded):
    """How the values of all parameters with a distribution are drawn."""

    method: Literal["random", "latin_hypercube", "sobol"] = "random"
    """Independent draws, a Latin hypercube, or a scrambled Sobol sequence."""
    samples: _Count
    """Number of joint draws; a power of two for `sobol`."""
    seed: _Seed = 1
    """Seed of the draws."""

    @model_validator(mode="after")
    def _fits_the_method(self) -> Self:
        if self.method == "sobol" and self.samples & (self.samples - 1):
            above = 1 << self.samples.bit_length()
            raise ValueError(
                f"samples = {self.samples}: a Sobol sequence needs a power of two, such as "
                f"{above // 2} or {above}"
            )
        return self


class StudyMetric(Bounded):
    """A metric with a name of its own, a function of the user, or parameters."""

    name: _Name
    """Name of the column in the table."""
    function: Annotated[str, Field(min_length=1)] | None = None
    """Built-in metric, `module:function` or `file.py:function`; default: that of `name`."""
    parameters: dict[str, Any] = Field(default_factory=dict)
    """Further arguments of the function."""
    worst: Literal["low", "high"] | None = None
    """Which values are bad; default: that of the built-in metric, else high."""


class StudyWorst(Bounded):
    """The runs that `logs = "worst"` and the report select."""

    metric: _Name
    """Metric by which runs are ordered."""
    count: _Count = 5
    """Number of runs."""


class StudyStop(Bounded):
    """Ends the runs of a parameter point when a metric's mean is known well enough."""

    metric: _Name
    """Metric whose mean is estimated."""
    half_width: Annotated[float, Field(gt=0.0)]
    """Half of the confidence interval's width at which a point needs no more runs."""
    confidence: _Fraction = 0.95
    """Confidence level."""
    min_repetitions: Annotated[int, Field(ge=2)] = 10
    """Runs of a point before the first decision."""
    every: Annotated[int, Field(ge=1)] = 10
    """Further runs between two decisions."""


class Study(Bounded):
    """Many runs of one scenario, as data."""

    name: _Name
    """Name of the study and of its results folder."""
    description: str = ""
    """Description in one line, for the report."""
    scenario: Annotated[str, Field(min_length=1)]
    """Shipped scenario's name, or the path of a TOML file beside the study."""
    duration_s: Annotated[float, Field(gt=0.0, le=1_000_000.0)] | None = None
    """Simulated time of a run, s; default: that of the scenario."""
    repetitions: _Count = 1
    """Runs of each parameter point, with the seeds `first_seed`, `first_seed` + 1, ..."""
    first_seed: _Seed = 1
    """Seed of the first repetition."""
    seeds: Annotated[tuple[_Seed, ...], Field(min_length=1)] | None = None
    """Seeds of each parameter point, instead of `repetitions` and `first_seed`."""
    metrics: Annotated[tuple[str | StudyMetric, ...], Field(min_length=1)] = (
        "success",
        "collisions",
        "distance_m",
        "time_s",
    )
    """Built-in metrics, `module:function`, `file.py:function`, or tables of them."""
    sample_rate_hz: Annotated[float, Field(gt=0.0, le=1000.0)] = 20.0
    """Samples of the true states per simulated second, for metrics and digests."""
    combine: Literal["grid", "list"] = "grid"
    """Parameters with values: every combination, or the first, second, ... of all together."""
    vectorized: Literal["auto"] | bool = "auto"
    """Whether runs are environments of a vectorized simulation; auto: where they can be."""
    sensors: Literal["needed", "all"] = "needed"
    """`needed`: sensors that nothing reads are left out, which changes no flight."""
    run_timeout_s: Annotated[float, Field(gt=0.0)] | None = None
    """Wall time after which a run counts as failed, s; None: none."""
    logs: Literal["none", "failed", "worst", "all"] = "none"
    """Runs whose log is kept; see `worst`."""
    worst: StudyWorst | None = None
    """Runs that are shown as the worst; default: by the first metric."""
    stop: StudyStop | None = None
    """When a parameter point needs no more runs; None: after its last repetition."""
    changes: dict[str, Any] = Field(default_factory=dict)
    """Changes to the scenario that all runs share, by paths of keys."""
    parameters: dict[_Name, StudyParameter] = Field(default_factory=dict)
    """Parameters by the names that they have in the table."""
    sampling: StudySampling | None = None
    """Draws of the parameters with a distribution."""

    @model_validator(mode="after")
    def _sampling_is_of_distributions(self) -> Self:
        random = [name for name, each in self.parameters.items() if each.is_random]
        if random and self.sampling is None:
            raise ValueError(
                f"parameter '{random[0]}' has a distribution: add [sampling] with 'samples'"
            )
        if self.sampling is not None and not random:
            raise ValueError("[sampling] needs a parameter with a 'distribution'")
        return self

    @model_validator(mode="after")
    def _lists_are_equally_long(self) -> Self:
        if self.combine == "list":
            counts = {n: _count_of(p) for n, p in self.parameters.items() if not p.is_random}
            if len(set(counts.values())) > 1:
                words = ", ".join(f"{name} {count}" for name, count in counts.items())
                raise ValueError(f'combine = "list" needs equally many values: {words}')
        return self

    @model_validator(mode="after")
    def _seeds_are_given_once(self) -> Self:
        given = self.model_fields_set
        if self.seeds is not None and given & {"repetitions", "first_seed"}:
            raise ValueError("give 'seeds', or 'repetitions' with 'first_seed', not both")
        if self.seeds is not None and len(set(self.seeds)) < len(self.seeds):
            raise ValueError("'seeds' contains a seed twice; equal runs give equal results")
        return self

    @property
    def all_seeds(self) -> tuple[int, ...]:
        """Seeds of each parameter point, in order."""
        if self.seeds is not None:
            return self.seeds
        return tuple(range(self.first_seed, self.first_seed + self.repetitions))


def _count_of(parameter: StudyParameter) -> int:
    return len(parameter.values) if parameter.values is not None else parameter.steps or 0
