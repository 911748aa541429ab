"""Networks of policies: against plain loops, row by row, and what does not fit."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from policy_making import (
    description,
    image_policy,
    mlp,
    small_policy,
)

from volery.autonomy.policy.policy_file import make_policy
from volery.core.errors import CommandError, DataFileError


def _convolve(image: Any, weight: Any, bias: Any, stride: int) -> Any:
    """Returns a convolution (out, h, w) by plain loops."""
    out, _, high, wide = weight.shape
    rows, columns = (image.shape[1] - high) // stride + 1, (image.shape[2] - wide) // stride + 1
    result = np.zeros((out, rows, columns))
    for o, r, c in np.ndindex(out, rows, columns):
        y, x = r * stride, c * stride
        result[o, r, c] = (image[:, y : y + high, x : x + wide] * weight[o]).sum() + bias[o]
    return result


def _layers(arrays: Any, name: str, x: Any) -> Any:
    k = 0
    while f"{name}.{k}.weight" in arrays:
        x = arrays[f"{name}.{k}.weight"].astype(float) @ x + arrays[f"{name}.{k}.bias"]
        k += 1
        if f"{name}.{k}.weight" in arrays:
            x = np.tanh(x)
    return x


def test_a_network_equals_its_products_one_by_one() -> None:
    policy = small_policy()
    x = np.linspace(-1.0, 1.0, 6)
    output = policy.network.evaluate(x)
    means = _layers(policy.network.arrays, "policy", x)
    assert output.outputs == pytest.approx(means, abs=1e-6)
    assert output.action == pytest.approx(np.clip(means, -1.0, 1.0), abs=1e-6)
    assert output.value == pytest.approx(_layers(policy.network.arrays, "value", x)[0], abs=1e-6)


def test_convolutions_equal_plain_loops() -> None:
    policy = image_policy()
    arrays = policy.network.arrays
    x = np.random.default_rng(1).normal(size=3 + 384 + 2)
    image = x[3:-2].reshape(2, 12, 16)
    for k, stride in ((0, 2), (1, 1)):
        prefix = f"image.depth.{k}"
        image = _convolve(image, arrays[f"{prefix}.weight"], arrays[f"{prefix}.bias"], stride)
        image = np.maximum(image, 0.0)
    features = np.concatenate([x[:3], image.ravel(), x[-2:]])
    output = policy.network.evaluate(x)
    assert output.outputs == pytest.approx(_layers(arrays, "policy", features), abs=1e-5)
    assert np.isnan(output.value)
    assert not policy.network.has_value


@pytest.mark.parametrize("policy", [small_policy(), image_policy()], ids=["mlp", "image"])
def test_a_row_does_not_depend_on_its_batch(policy: Any) -> None:
    x = np.random.default_rng(2).normal(size=(37, policy.network.input_size))
    batch = policy.network.evaluate(x)
    for k in range(len(x)):
        one = policy.network.evaluate(x[k])
        assert one.outputs.tobytes() == batch.outputs[k].tobytes()
        assert one.value.tobytes() == batch.value[k].tobytes()
    shaped = policy.network.evaluate(x[:36].reshape(4, 9, -1))
    assert shaped.outputs.tobytes() == batch.outputs[:36].tobytes()


def test_choices_are_the_largest_output_which_is_the_value() -> None:
    rng = np.random.default_rng(0)
    described = description(
        action={"kind": "discrete_velocity", "size": 1, "choices": 7}, network={"output": "argmax"}
    )
    policy = make_policy(described, mlp("policy", [6, 5, 7], rng))
    output = policy.network.evaluate(rng.normal(size=(3, 6)))
    assert output.action.shape == (3, 1)
    assert (output.action[:, 0] == output.outputs.argmax(axis=1)).all()
    assert (output.value == output.outputs.max(axis=1)).all()


def test_squashed_outputs_and_rectified_layers() -> None:
    policy = small_policy(network={"output": "tanh", "activation": "relu"})
    output = policy.network.evaluate(np.full(6, 3.0))
    assert output.action == pytest.approx(np.tanh(output.outputs))


@pytest.mark.parametrize("bad", [np.zeros(5), np.zeros((2, 7)), np.full(6, np.nan), np.float64(1)])
def test_observations_that_do_not_fit_are_refused(bad: Any) -> None:
    with pytest.raises(CommandError, match="observation"):
        small_policy().network.evaluate(bad)


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"policy.0.weight": np.zeros((8, 5))}, "'policy.0.weight' has shape"),
        ({"policy.0.bias": np.zeros(7)}, "'policy.0.bias' has shape"),
        ({"policy.1.weight": np.zeros((3, 8)), "policy.1.bias": np.zeros(3)}, "3 outputs; 4 are"),
        ({"policy.1.bias": None}, "'policy.1.bias' is missing"),
        ({"policy.0.weight": np.full((8, 6), np.nan)}, "not finite"),
        ({"policy.0.weight": np.full((8, 6), 1e300)}, "not finite"),
        ({"policy.0.weight": np.zeros((8, 6), "U1")}, "numbers are needed"),
        ({"policy.3.weight": np.zeros((8, 6))}, "belongs to no layer"),
        ({"policy.0.weight": None}, "0 layers"),
        ({"policy.0.weight": np.zeros(8)}, "2 dimensions"),
        ({"value.1.weight": np.zeros((2, 8)), "value.1.bias": np.zeros(2)}, "2 outputs; 1 are"),
    ],
)
def test_arrays_that_do_not_fit_are_named(change: dict[str, Any], text: str) -> None:
    rng = np.random.default_rng(0)
    arrays = mlp("policy", [6, 8, 4], rng) | mlp("value", [6, 8, 1], rng) | change
    with pytest.raises(DataFileError, match=text):
        make_policy(description(), {k: v for k, v in arrays.items() if v is not None})
