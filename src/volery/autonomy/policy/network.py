"""Computes a policy's network with numpy.

Names of the arrays, float32: `policy.K.weight` (out, in) and `policy.K.bias` (out,) of each layer
from K = 0; likewise `value.K...` for the value, if the file has one; `image.PART.K.weight`
(out, in, height, width) and `image.PART.K.bias` of the convolutions of an image part.

The input is the observation; each image part is replaced by the result of its convolutions,
flattened from (channels, height, width). The result of an observation does not depend, to the last
bit, on the others in its batch.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import ArrayLike, NDArray

from volery.autonomy.policy.description import ImageEncoder, PolicyDescription
from volery.core.errors import CommandError, DataFileError

Floats = NDArray[np.float32]
_MAX_LAYERS = 8


class _Layer(NamedTuple):
    weight: Floats
    """(in, out)."""
    bias: Floats


class _Convolution(NamedTuple):
    weight: Floats
    """(in * height * width, out)."""
    bias: Floats
    window: tuple[int, int]
    stride: int


class _Encoder(NamedTuple):
    first: int
    last: int
    shape: tuple[int, int, int]
    convolutions: tuple[_Convolution, ...]
    activation: str


class PolicyOutput(NamedTuple):
    """What a network computes for observations of leading shape (...)."""

    action: NDArray[np.float64]
    """(..., A): continuous ones from -1 to 1, or the index of the choice."""
    value: Floats
    """(...) expected return; NaN where the policy has none."""
    outputs: Floats
    """(..., O) outputs before they become the action: means, or the value of each choice."""


class Network:
    """The weights of a policy, checked, and their use."""

    def __init__(self, description: PolicyDescription, arrays: dict[str, NDArray[Any]]) -> None:
        """Checks the arrays. Raises `DataFileError` naming one that does not fit."""
        self.arrays: dict[str, Floats] = {
            name: _checked(name, array) for name, array in arrays.items()
        }
        """Weights by name."""
        self.input_size = description.observation_size
        """Numbers that the network takes."""
        self._activation = description.network.activation
        self._output = description.network.output
        unused = set(self.arrays)
        self._encoders = tuple(
            self._encoder(description, encoder, unused) for encoder in description.network.images
        )
        encoded = sum(_encoded_size(encoder) for encoder in self._encoders)
        raw = sum(encoder.last - encoder.first for encoder in self._encoders)
        features = self.input_size - raw + encoded
        self._policy = self._layers("policy", features, description.output_size, unused)
        self._value: tuple[_Layer, ...] = ()
        if "value.0.weight" in unused:
            self._value = self._layers("value", features, 1, unused)
        if unused:
            raise DataFileError(f"array '{min(unused)}' belongs to no layer")

    @property
    def has_value(self) -> bool:
        """Whether the network computes the value of observations."""
        return bool(self._value) or self._output == "argmax"

    def evaluate(self, observation: ArrayLike) -> PolicyOutput:
        """Returns action, value and outputs of observations (..., D).

        D is `input_size`. Raises `CommandError` for another size or numbers that are not finite.
        Outputs of large weights may overflow: then they are not finite.
        """
        x = np.ascontiguousarray(observation, np.float32)
        if x.shape[-1:] != (self.input_size,):
            raise CommandError(
                f"the policy takes observations of {self.input_size} numbers, not {x.shape}"
            )
        if not np.isfinite(x).all():
            raise CommandError("the observation is not finite")
        with np.errstate(over="ignore", invalid="ignore"):
            features = self._features(x)
            outputs = self._forward(self._policy, features)
            value = self._value_of(features, outputs)
        return PolicyOutput(self._action(outputs), value, outputs)

    def act(self, observation: ArrayLike) -> NDArray[np.float64]:
        """Returns the actions (..., A) of observations (..., D), as `evaluate` does.

        Raises `CommandError` also for outputs that are not finite.
        """
        output = self.evaluate(observation)
        if not np.isfinite(output.outputs).all():
            raise CommandError("the policy's outputs are not finite")
        return output.action

    # ------------------------------------------------------------------------------------- inside

    def _action(self, outputs: Floats) -> NDArray[np.float64]:
        if self._output == "argmax":
            return np.asarray(outputs.argmax(axis=-1)[..., None], np.float64)
        if self._output == "tanh":
            return np.tanh(outputs).astype(np.float64)
        return np.clip(outputs, -1.0, 1.0).astype(np.float64)

    def _value_of(self, features: Floats, outputs: Floats) -> Floats:
        if self._value:
            return self._forward(self._value, features)[..., 0]
        if self._output == "argmax":
            return np.asarray(outputs.max(axis=-1))
        return np.full(outputs.shape[:-1], np.nan, np.float32)

    def _forward(self, layers: tuple[_Layer, ...], features: Floats) -> Floats:
        # One product for each row: a product of all rows would sum in another order.
        x = features[..., None, :]
        for layer in layers[:-1]:
            x = _activate(x @ layer.weight + layer.bias, self._activation)
        last = layers[-1]
        result: Floats = (x @ last.weight + last.bias)[..., 0, :]
        return result

    def _features(self, x: Floats) -> Floats:
        if not self._encoders:
            return x
        parts, end = [], 0
        for encoder in sorted(self._encoders):
            parts += [x[..., end : encoder.first], _encode(encoder, x)]
            end = encoder.last
        return np.concatenate([*parts, x[..., end:]], axis=-1)

    def _layers(self, name: str, size: int, outputs: int, unused: set[str]) -> tuple[_Layer, ...]:
        layers: list[_Layer] = []
        while f"{name}.{len(layers)}.weight" in self.arrays:
            prefix = f"{name}.{len(layers)}"
            weight, bias = self._pair(prefix, unused, 2)
            if weight.shape[1] != size:
                raise DataFileError(
                    f"array '{prefix}.weight' has shape {weight.shape}; (.., {size}) is needed"
                )
            size = weight.shape[0]
            layers.append(_Layer(np.ascontiguousarray(weight.T), bias))
        if not 1 <= len(layers) <= _MAX_LAYERS:
            raise DataFileError(
                f"network '{name}' has {len(layers)} layers; 1 to {_MAX_LAYERS} are allowed"
            )
        if size != outputs:
            raise DataFileError(f"network '{name}' has {size} outputs; {outputs} are needed")
        return tuple(layers)

    def _encoder(
        self, description: PolicyDescription, encoder: ImageEncoder, unused: set[str]
    ) -> _Encoder:
        first = 0
        for part in description.observation:
            if part.name == encoder.part:
                break
            first += part.numbers
        channels, height, width = encoder.shape
        convolutions = []
        for number, stride in enumerate(encoder.strides):
            prefix = f"image.{encoder.part}.{number}"
            if f"{prefix}.weight" not in self.arrays:
                raise DataFileError(f"array '{prefix}.weight' is missing")
            weight, bias = self._pair(prefix, unused, 4)
            out, _, *window = weight.shape
            if weight.shape[1] != channels or window[0] > height or window[1] > width:
                raise DataFileError(
                    f"array '{prefix}.weight' has shape {weight.shape}, which does not fit "
                    f"({channels}, {height}, {width})"
                )
            flat = np.ascontiguousarray(weight.reshape(out, -1).T)
            convolutions.append(_Convolution(flat, bias, (window[0], window[1]), stride))
            channels = out
            height = (height - window[0]) // stride + 1
            width = (width - window[1]) // stride + 1
        last = first + int(np.prod(encoder.shape))
        return _Encoder(first, last, encoder.shape, tuple(convolutions), encoder.activation)

    def _pair(self, prefix: str, unused: set[str], dimensions: int) -> tuple[Floats, Floats]:
        weight, bias = self.arrays[f"{prefix}.weight"], self.arrays.get(f"{prefix}.bias")
        if weight.ndim != dimensions or not weight.size:
            raise DataFileError(
                f"array '{prefix}.weight' has shape {weight.shape}; {dimensions} dimensions are "
                "needed"
            )
        if bias is None or bias.shape != weight.shape[:1]:
            found = "is missing" if bias is None else f"has shape {bias.shape}"
            raise DataFileError(f"array '{prefix}.bias' {found}; ({weight.shape[0]},) is needed")
        unused -= {f"{prefix}.weight", f"{prefix}.bias"}
        return weight, bias


def _checked(name: str, array: NDArray[Any]) -> Floats:
    if array.dtype.kind not in "fiu":
        raise DataFileError(f"array '{name}' has type {array.dtype}; numbers are needed")
    with np.errstate(over="ignore"):
        result = np.ascontiguousarray(array, np.float32)
    if not np.isfinite(result).all():
        raise DataFileError(f"array '{name}' has weights that are not finite")
    result.flags.writeable = False
    return result


def _activate(x: Floats, activation: str) -> Floats:
    return np.tanh(x) if activation == "tanh" else np.maximum(x, np.float32(0.0))


def _encoded_size(encoder: _Encoder) -> int:
    _, height, width = encoder.shape
    for convolution in encoder.convolutions:
        height = (height - convolution.window[0]) // convolution.stride + 1
        width = (width - convolution.window[1]) // convolution.stride + 1
    return len(encoder.convolutions[-1].bias) * height * width


def _encode(encoder: _Encoder, x: Floats) -> Floats:
    """Returns the features (..., F) of the image part of observations (..., D)."""
    lead = x.shape[:-1]
    image = x[..., encoder.first : encoder.last].reshape(*lead, *encoder.shape)
    for convolution in encoder.convolutions:
        stride = convolution.stride
        windows = sliding_window_view(image, convolution.window, axis=(-2, -1))
        windows = windows[..., ::stride, ::stride, :, :]
        height, width = windows.shape[-4:-2]
        # (..., height, width, channels, window): one row for each pixel
        rows = np.moveaxis(windows, -5, -3).reshape(*lead, height * width, -1)
        result = _activate(rows @ convolution.weight + convolution.bias, encoder.activation)
        image = np.moveaxis(result, -1, -2).reshape(*lead, -1, height, width)
    return np.ascontiguousarray(image.reshape(*lead, -1))
