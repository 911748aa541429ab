"""The networks of policies: an actor and a critic, small and fully connected."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor, nn
from torch.distributions import Categorical, Distribution, Independent, Normal


class ActorCritic(nn.Module):
    """Maps observations (B, D) to actions and values.

    choices: number of choices of a discrete action, None for continuous ones of `action_size`
    numbers, which are normal with a standard deviation of their own.
    """

    def __init__(
        self,
        observation_size: int,
        action_size: int,
        choices: int | None,
        *,
        hidden: Sequence[int] = (64, 64),
        initial_std: float = 0.5,
    ) -> None:
        super().__init__()
        self.choices = choices
        outputs = action_size if choices is None else choices
        self.actor = _layers(observation_size, hidden, outputs, 0.01)
        self.critic = _layers(observation_size, hidden, 1, 1.0)
        std = torch.full((action_size,), initial_std)
        self.log_std = nn.Parameter(std.log(), requires_grad=choices is None)

    def distribution(self, observation: Tensor) -> Distribution:
        """Returns the distribution of actions (B, A), or of choices (B,)."""
        output = self.actor(observation)
        if self.choices is not None:
            return Categorical(logits=output, validate_args=False)
        normal = Normal(output, self.log_std.exp().expand_as(output), validate_args=False)
        return Independent(normal, 1, validate_args=False)

    def value(self, observation: Tensor) -> Tensor:
        """Returns the values (B,)."""
        values: Tensor = self.critic(observation).squeeze(-1)
        return values

    def best(self, observation: Tensor) -> Tensor:
        """Returns the most likely action (B, A), or choice (B,)."""
        output: Tensor = self.actor(observation)
        return output if self.choices is None else output.argmax(dim=-1)


def _layers(inputs: int, hidden: Sequence[int], outputs: int, gain: float) -> nn.Sequential:
    layers: list[nn.Module] = []
    for width in hidden:
        layers += [_linear(inputs, width, 2.0**0.5), nn.Tanh()]
        inputs = width
    return nn.Sequential(*layers, _linear(inputs, outputs, gain))


def _linear(inputs: int, outputs: int, gain: float) -> nn.Linear:
    layer = nn.Linear(inputs, outputs)
    nn.init.orthogonal_(layer.weight, gain)
    nn.init.zeros_(layer.bias)
    return layer
