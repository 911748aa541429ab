"""Exports policies as ONNX: the network alone, with observations as input and actions as output."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from volery.autonomy.policy.policy_file import Policy
from volery.autonomy.policy.shipped_policies import load_policy
from volery.core.errors import VoleryError, reason_of
from volery.core.extras import import_extra
from volery.core.whole_files import write_whole

_OPSET = 17
_IR_VERSION = 8
_ACTIVATIONS = {"tanh": "Tanh", "relu": "Relu"}


def export_onnx(name: str | Policy, file: Path) -> str:
    """Writes a policy (shipped name, file or `Policy`) as ONNX; returns a line about it.

    The input `observation` is (N, D) float32; the output `action` is (N, A) float32 from -1 to 1,
    or the choice (N,) int64. Raises `VoleryError` without the package onnx, or if the file cannot
    be written.
    """
    onnx = import_extra("export to ONNX", "onnx", "onnx", "train")
    policy = name if isinstance(name, Policy) else load_policy(name)
    graph = _Graph(policy)
    model = onnx.helper.make_model(
        graph.build(),
        opset_imports=[onnx.helper.make_opsetid("", _OPSET)],
        ir_version=_IR_VERSION,
        producer_name="volery",
        doc_string=f"policy of task {policy.description.task}",
    )
    onnx.checker.check_model(model, full_check=True)
    try:
        write_whole(file, model.SerializeToString())
    except OSError as error:
        raise VoleryError(f"{file}: {reason_of(error)}") from None
    return (
        f"{file}: observation (N, {policy.network.input_size}) to action "
        f"(N{'' if graph.is_discrete else f', {policy.description.action.size}'})"
    )


class _Graph:
    """Nodes of the network of a policy."""

    def __init__(self, policy: Policy) -> None:
        self._policy = policy
        self._nodes: list[Any] = []
        self._constants: list[Any] = []
        self.is_discrete = policy.description.network.output == "argmax"

    def build(self) -> Any:
        """Returns the graph."""
        from onnx import TensorProto, helper

        description = self._policy.description
        x = self._features("observation")
        x = self._layers(x, _ACTIVATIONS[description.network.activation])
        self._action(x)
        size: list[str | int | None] = ["n"] if self.is_discrete else ["n", description.action.size]
        kind = TensorProto.INT64 if self.is_discrete else TensorProto.FLOAT
        width = self._policy.network.input_size
        return helper.make_graph(
            self._nodes,
            description.task,
            [helper.make_tensor_value_info("observation", TensorProto.FLOAT, ["n", width])],
            [helper.make_tensor_value_info("action", kind, size)],
            self._constants,
        )

    def _features(self, x: str) -> str:
        """Replaces each image part by the flattened result of its convolutions."""
        description = self._policy.description
        encoders = {encoder.part: encoder for encoder in description.network.images}
        if not encoders:
            return x
        parts, first = [], 0
        for part in description.observation:
            last = first + part.numbers
            bounds = [self._constant(np.array([value])) for value in (first, last, 1)]
            piece = self._node("Slice", [x, bounds[0], bounds[1], bounds[2]])
            encoder = encoders.get(part.name)
            parts.append(piece if encoder is None else self._encoded(piece, encoder))
            first = last
        return self._node("Concat", parts, axis=1)

    def _encoded(self, x: str, encoder: Any) -> str:
        x = self._node("Reshape", [x, self._constant(np.array([-1, *encoder.shape]))])
        arrays = self._policy.network.arrays
        for k, stride in enumerate(encoder.strides):
            prefix = f"image.{encoder.part}.{k}"
            weights = [self._constant(arrays[f"{prefix}.{name}"]) for name in ("weight", "bias")]
            x = self._node("Conv", [x, *weights], strides=[stride, stride])
            x = self._node(_ACTIVATIONS[encoder.activation], [x])
        return self._node("Flatten", [x], axis=1)

    def _layers(self, x: str, activation: str) -> str:
        arrays, k = self._policy.network.arrays, 0
        while f"policy.{k}.weight" in arrays:
            if k:
                x = self._node(activation, [x])
            weights = [self._constant(arrays[f"policy.{k}.{name}"]) for name in ("weight", "bias")]
            x = self._node("Gemm", [x, *weights], transB=1)
            k += 1
        return x

    def _action(self, x: str) -> None:
        output = self._policy.description.network.output
        if output == "argmax":
            self._node("ArgMax", [x], "action", axis=1, keepdims=0)
        elif output == "tanh":
            self._node("Tanh", [x], "action")
        else:
            limits = [self._constant(np.float32(limit)) for limit in (-1.0, 1.0)]
            self._node("Clip", [x, *limits], "action")

    def _node(self, kind: str, inputs: list[str], output: str = "", **attributes: Any) -> str:
        from onnx import helper

        output = output or f"{kind.lower()}_{len(self._nodes)}"
        self._nodes.append(helper.make_node(kind, inputs, [output], **attributes))
        return output

    def _constant(self, array: Any) -> str:
        from onnx import numpy_helper

        name = f"constant_{len(self._constants)}"
        self._constants.append(numpy_helper.from_array(np.asarray(array), name))
        return name
