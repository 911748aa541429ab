"""Checkpoints of a training: one file from which it continues to the same result.

A file is one line that names the format, one line of JSON (task, algorithm, configuration, length
and checksum), and the state as a pickle. Reading it creates only arrays, numbers and the classes
listed here, so that a file of another origin cannot run code.
"""

from __future__ import annotations

import hashlib
import io
import json
import pickle
import random
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch

from volery.core.errors import VoleryError, reason_of
from volery.core.whole_files import whole_file

_MAGIC = b"volery checkpoint 1\n"
_CLASSES = {
    "builtins": {"set", "frozenset", "bytearray", "complex", "slice", "range"},
    "collections": {"deque", "OrderedDict"},
    "numpy": {"ndarray", "dtype"},
    "numpy._core.multiarray": {"_reconstruct", "scalar"},
    "numpy._core.numeric": {"_frombuffer"},
    "volery.learning.training.records": {"Latest", "CurvePoint", "EpisodesPoint"},
    "volery.world.weather.model": {"Weather"},
    "volery.world.weather.particles": {"Particles"},
    "volery.learning.training.checkpoint": {"_tensor"},
}


@dataclass(frozen=True)
class Checkpoint:
    """Content of a checkpoint."""

    task: str
    algorithm: str
    configuration: dict[str, Any]
    state: dict[str, Any]


def write_checkpoint(path: Path, checkpoint: Checkpoint) -> None:
    """Writes a checkpoint whole or not at all.

    Raises `VoleryError` if the file cannot be written.
    """
    buffer = io.BytesIO()
    _Pickler(buffer, protocol=5).dump(checkpoint.state)
    payload = buffer.getvalue()
    header = {
        "task": checkpoint.task,
        "algorithm": checkpoint.algorithm,
        "configuration": checkpoint.configuration,
        "length": len(payload),
        "sha256": hashlib.sha256(payload).hexdigest(),
    }
    try:
        with whole_file(path, durable=True) as file:
            file.write(_MAGIC + json.dumps(header).encode() + b"\n")
            file.write(payload)
    except OSError as error:
        raise VoleryError(f"{path}: cannot write the checkpoint: {reason_of(error)}") from None


def read_checkpoint(path: Path) -> Checkpoint:
    """Returns a checkpoint. Raises `VoleryError` if it is missing, cut off, damaged or foreign."""
    try:
        content = path.read_bytes()
    except OSError as error:
        raise VoleryError(f"{path}: no checkpoint to resume from: {reason_of(error)}") from None
    if not content.startswith(_MAGIC):
        is_other = content.startswith(_MAGIC.rsplit(b" ", 1)[0])
        what = "a checkpoint of another version of Volery" if is_other else "not a checkpoint"
        raise VoleryError(f"{path}: {what}; train anew")
    line, _, payload = content[len(_MAGIC) :].partition(b"\n")
    try:
        header = json.loads(line)
        if len(payload) != header["length"]:
            raise VoleryError(
                f"{path}: the checkpoint is cut off ({len(payload):,} of {header['length']:,} "
                "bytes); train anew"
            )
        if hashlib.sha256(payload).hexdigest() != header["sha256"]:
            raise VoleryError(f"{path}: the checkpoint is damaged; train anew")
        state = _Unpickler(io.BytesIO(payload)).load()
        return Checkpoint(header["task"], header["algorithm"], header["configuration"], state)
    except (ValueError, KeyError, TypeError, pickle.UnpicklingError, EOFError) as error:
        raise VoleryError(f"{path}: the checkpoint is damaged ({error}); train anew") from None


def check_task(checkpoint: Checkpoint, task: str, path: Path) -> None:
    """Raises `VoleryError` if a checkpoint, read from `path`, is of another task."""
    if checkpoint.task != task:
        raise VoleryError(f"{path}: the checkpoint is of task '{checkpoint.task}', not '{task}'")


def random_states() -> dict[str, Any]:
    """Returns the states of the random numbers of torch, numpy and Python."""
    return {
        "torch": torch.get_rng_state().numpy().copy(),
        "numpy": np.random.get_state(legacy=False),  # noqa: NPY002  (buffers of the library use it)
        "python": random.getstate(),
    }


def restore_random_states(states: dict[str, Any]) -> None:
    """Restores what `random_states` returned."""
    torch.set_rng_state(torch.from_numpy(states["torch"].copy()))
    np.random.set_state(states["numpy"])  # noqa: NPY002
    random.setstate(states["python"])


def _tensor(array: np.ndarray) -> torch.Tensor:
    return torch.from_numpy(array.copy())


class _Pickler(pickle.Pickler):
    """Writes tensors as arrays."""

    def reducer_override(self, obj: Any) -> Any:
        """Returns how a tensor is made again from an array."""
        if isinstance(obj, torch.Tensor):
            return _tensor, (obj.detach().cpu().numpy(),)
        return NotImplemented


class _Unpickler(pickle.Unpickler):
    """Creates only the classes that checkpoints contain."""

    def find_class(self, module: str, name: str) -> Any:
        """Returns a class. Raises `UnpicklingError` for one that no checkpoint contains."""
        is_known = name in _CLASSES.get(module, ()) or module == "numpy.dtypes"
        if not is_known:
            raise pickle.UnpicklingError(f"it contains {module}.{name}")
        return super().find_class(module, name)
