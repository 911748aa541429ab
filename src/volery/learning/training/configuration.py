"""Configuration of a training, as data: read from TOML, checked, with defaults."""

from __future__ import annotations

import tomllib
from importlib import resources
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field

from volery.core.errors import VoleryError, reason_of
from volery.core.toml_text import parse_toml
from volery.scenario.base import Bounded
from volery.scenario.validation import validated

Algorithm = Literal["ppo", "dqn", "sac"]
_BASELINES = resources.files("volery.learning") / "baselines"


class PpoOptions(Bounded):
    """Options of proximal policy optimization."""

    rollout_steps: Annotated[int, Field(ge=2)] = 32
    """Decisions of each environment between two updates."""
    minibatch: Annotated[int, Field(ge=2)] = 4096
    """Decisions in one gradient step."""
    epochs: Annotated[int, Field(ge=1)] = 4
    """Passes over the decisions of a rollout."""
    gae_lambda: Annotated[float, Field(ge=0.0, le=1.0)] = 0.95
    clip_range: Annotated[float, Field(gt=0.0)] = 0.2
    entropy_weight: Annotated[float, Field(ge=0.0)] = 0.0
    value_weight: Annotated[float, Field(ge=0.0)] = 0.5
    max_gradient: Annotated[float, Field(gt=0.0)] = 0.5
    initial_log_std: float = -0.5
    """Logarithm of the first standard deviation of continuous actions."""


class DqnOptions(Bounded):
    """Options of deep Q-learning."""

    buffer_size: Annotated[int, Field(ge=1)] = 100_000
    batch: Annotated[int, Field(ge=1)] = 256
    rollout_steps: Annotated[int, Field(ge=1)] = 1
    """Decisions of each environment between two updates."""
    gradient_steps: Annotated[int, Field(ge=1)] = 1
    """Gradient steps of an update."""
    learning_starts: Annotated[int, Field(ge=0)] = 1_000
    """Decisions of all environments before the first update."""
    target_period: Annotated[int, Field(ge=1)] = 1_000
    """Decisions of all environments between two updates of the target network."""
    tau: Annotated[float, Field(gt=0.0, le=1.0)] = 1.0
    """Fraction by which an update moves the target network."""
    final_exploration: Annotated[float, Field(ge=0.0, le=1.0)] = 0.05
    """Fraction of random actions at the end."""
    exploration_fraction: Annotated[float, Field(gt=0.0, le=1.0)] = 0.3
    """Fraction of the training in which random actions become rare."""
    max_gradient: Annotated[float, Field(gt=0.0)] = 10.0


class SacOptions(Bounded):
    """Options of the soft actor-critic."""

    buffer_size: Annotated[int, Field(ge=1)] = 300_000
    batch: Annotated[int, Field(ge=1)] = 512
    rollout_steps: Annotated[int, Field(ge=1)] = 1
    """Decisions of each environment between two updates."""
    gradient_steps: Annotated[int, Field(ge=1)] = 8
    """Gradient steps of an update."""
    learning_starts: Annotated[int, Field(ge=0)] = 5_000
    """Decisions of all environments before the first update."""
    tau: Annotated[float, Field(gt=0.0, le=1.0)] = 0.01
    """Fraction by which target networks follow."""


class TrainingConfiguration(Bounded):
    """Everything that defines a training, apart from the task."""

    algorithm: Algorithm = "ppo"
    num_envs: Annotated[int, Field(ge=1)] = 256
    steps: Annotated[int, Field(ge=1)] = 2_000_000
    """Decisions of all environments at most; schedules end there."""
    seconds: Annotated[float, Field(ge=0.0)] = 0.0
    """Wall time at most, s; 0: no limit."""
    seed: Annotated[int, Field(ge=0, lt=1 << 24)] = 0
    threads: Annotated[int, Field(ge=1)] = 2
    """Threads of the simulation."""
    torch_threads: Annotated[int, Field(ge=1)] = 1
    """Threads of the networks."""
    target_success: Annotated[float, Field(ge=0.0)] = 0.95
    """Fraction of evaluation episodes that succeed at which training ends; above 1: never."""
    evaluation_episodes: Annotated[int, Field(ge=1)] = 200
    evaluation_period: Annotated[int, Field(ge=1)] = 100_000
    """Decisions of all environments between two evaluations."""
    evaluation_from: Annotated[float, Field(ge=0.0, le=1.0)] = 0.0
    """Fraction of the last training episodes that must succeed before the first evaluation."""
    hidden: tuple[int, ...] = (64, 64)
    """Units of the hidden layers of each network."""
    activation: Literal["tanh", "relu"] = "tanh"
    gamma: Annotated[float, Field(gt=0.0, le=1.0)] = 0.99
    """Discount of the reward of the next decision."""
    learning_rate: Annotated[float, Field(gt=0.0)] = 1e-3
    final_learning_rate: Annotated[float | None, Field(ge=0.0)] = None
    """Learning rate at the end of `steps`, to which it falls linearly; None: constant."""
    reward_scale: Annotated[float, Field(gt=0.0)] = 1.0
    """Factor of rewards, so that values are near 1."""
    ppo: PpoOptions = PpoOptions()
    dqn: DqnOptions = DqnOptions()
    sac: SacOptions = SacOptions()

    def changed(self, **options: Any) -> TrainingConfiguration:
        """Returns the configuration with other `options`; those that are None stay.

        Raises `VoleryError` for an option that is out of range.
        """
        chosen = {name: value for name, value in options.items() if value is not None}
        made = {**self.model_dump(), **chosen}
        return validated(made, TrainingConfiguration, "configuration of the training")


def load_configuration(task: str, file: str | Path | None = None) -> TrainingConfiguration:
    """Returns the configuration in a TOML file, or the one that ships for `task`, or defaults.

    Raises `VoleryError` for a file that is missing, not TOML, or has a wrong value.
    """
    if file is not None:
        try:
            text = Path(file).read_text(encoding="utf-8-sig")
        except (OSError, UnicodeDecodeError) as error:
            raise VoleryError(f"{file}: {reason_of(error)}") from None
        return _parsed(text, str(file))
    shipped = _BASELINES / f"{task}.toml"
    return (
        _parsed(shipped.read_text(encoding="utf-8-sig"), shipped.name)
        if shipped.is_file()
        else (TrainingConfiguration())
    )


def _parsed(text: str, name: str) -> TrainingConfiguration:
    try:
        data = parse_toml(text)
    except tomllib.TOMLDecodeError as error:
        raise VoleryError(f"{name}: not TOML: {error}") from None
    return validated(data, TrainingConfiguration, name)
