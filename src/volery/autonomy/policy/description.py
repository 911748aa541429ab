"""Describes a policy: what it observes, what it commands, how its network is made and trained.

The description is JSON text inside the policy's file (see `policy_file`).
"""

from __future__ import annotations

from typing import Annotated, Any, Final, Literal, Self

from pydantic import Field, JsonValue, model_validator

from volery.scenario.base import Bounded

FORMAT: Final = 1
"""Number of the format that this version writes and reads."""

_Name = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]*$", max_length=60)]
_Count = Annotated[int, Field(ge=1, le=1_000_000)]
_Positive = Annotated[float, Field(gt=0.0)]
Parameters = dict[_Name, JsonValue]


class ObservationPart(Bounded):
    """A part of the observation, in the order of the network's input."""

    name: _Name
    """Name in the registry of `observation_parts`."""
    size: _Count
    """Numbers at one decision."""
    history: Annotated[int, Field(ge=1, le=64)] = 1
    """Decisions whose numbers the network receives together, the oldest first."""
    unit: Annotated[str, Field(max_length=20)] = "1"
    scale: _Positive = 1.0
    """Divides the numbers."""
    limit: _Positive = 10.0
    """Largest absolute value after the scale; numbers beyond are clipped."""
    parameters: Parameters = Field(default_factory=dict)

    @property
    def numbers(self) -> int:
        """Numbers of this part in the network's input, its history included."""
        return self.size * self.history


class ActionPart(Bounded):
    """The action: the level of the commands and their limits."""

    kind: _Name
    """Name in the registry of `action_terms`."""
    size: Annotated[int, Field(ge=1, le=64)]
    """Numbers in the action."""
    choices: Annotated[int, Field(ge=2, le=1000)] | None = None
    """Number of choices of a discrete action; None: continuous, from -1 to 1."""
    parameters: Parameters = Field(default_factory=dict)


class ImageEncoder(Bounded):
    """Convolutions over one image part, each followed by the activation."""

    part: _Name
    """Name of the observation part, flattened from (channels, height, width)."""
    shape: tuple[_Count, _Count, _Count]
    """Channels, height and width."""
    strides: Annotated[tuple[Annotated[int, Field(ge=1, le=16)], ...], Field(min_length=1)]
    """Stride of each convolution, from the first."""
    activation: Literal["tanh", "relu"] = "relu"


class NetworkDescription(Bounded):
    """The network, whose weights are the arrays of the file."""

    activation: Literal["tanh", "relu"] = "tanh"
    """Activation after each layer but the last."""
    output: Literal["clip", "tanh", "argmax"] = "clip"
    """How outputs become the action: clipped to -1..1, by tanh, or the index of the largest."""
    images: tuple[ImageEncoder, ...] = ()


class TrainingRecord(Bounded):
    """How the policy was trained, and how often it succeeds."""

    algorithm: Annotated[str, Field(max_length=40)] = ""
    steps: Annotated[int, Field(ge=0)] = 0
    """Decisions of all environments together."""
    seconds: Annotated[float, Field(ge=0.0)] = 0.0
    seed: Annotated[int, Field(ge=0)] = 0
    success: Annotated[float, Field(ge=0.0, le=1.0)] | None = None
    """Fraction of evaluated episodes that succeed; None: not evaluated."""
    episodes: Annotated[int, Field(ge=0)] = 0
    """Evaluated episodes."""


class PolicyDescription(Bounded):
    """All that is to know about a policy but its weights."""

    format: Literal[1] = FORMAT
    task: _Name
    airframe: Annotated[str, Field(max_length=100)]
    """Airframe that the policy is trained for."""
    observation: Annotated[tuple[ObservationPart, ...], Field(min_length=1)]
    action: ActionPart
    decision_rate_hz: Annotated[float, Field(gt=0.0, le=1000.0)]
    action_latency_s: Annotated[float, Field(ge=0.0, le=10.0)] = 0.0
    """Largest latency of actions in training; the vehicle has its own."""
    network: NetworkDescription = NetworkDescription()
    training: TrainingRecord = TrainingRecord()

    @property
    def observation_size(self) -> int:
        """Numbers in the network's input."""
        return sum(part.numbers for part in self.observation)

    @property
    def output_size(self) -> int:
        """Outputs of the network: the size of the action, or the number of choices."""
        return self.action.choices or self.action.size

    @model_validator(mode="after")
    def _fits_together(self) -> Self:
        names = [part.name for part in self.observation]
        if len(set(names)) < len(names):
            raise ValueError("two parts of the observation have the same name")
        for encoder in self.network.images:
            sizes = [part.numbers for part in self.observation if part.name == encoder.part]
            if len(sizes) != 1:
                raise ValueError(
                    f"network.images: '{encoder.part}' is not one of the parts {', '.join(names)}"
                )
            channels, height, width = encoder.shape
            if channels * height * width != sizes[0]:
                raise ValueError(
                    f"network.images: shape {list(encoder.shape)} of '{encoder.part}' does not "
                    f"have its {sizes[0]} numbers"
                )
        if (self.action.choices is None) == (self.network.output == "argmax"):
            raise ValueError("network.output must be 'argmax' where the action has choices only")
        return self

    def to_json(self) -> dict[str, Any]:
        """Returns the description as plain data."""
        return self.model_dump(mode="json")
