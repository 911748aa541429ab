"""Policy files: damaged archives, and whole ones with other descriptions and arrays."""

from __future__ import annotations

import contextlib
import io
import json
import zipfile
from functools import cache
from pathlib import Path

import numpy as np
from policy_making import chasing_policy, image_policy, small_policy
from scratch_files import path_of

from volery.autonomy.policy.policy_file import policy_from_bytes, write_policy
from volery.core.errors import CommandError, DataFileError

_MAX_INPUTS = 100_000
"""Observations that the check makes; files may describe larger ones."""


@cache
def _files():
    return [_bytes_of(policy) for policy in (small_policy(), chasing_policy(), image_policy())]


def _bytes_of(policy):
    path = Path(path_of("policy.npz"))
    write_policy(path, policy)
    return path.read_bytes()


@cache
def _members():
    """The descriptions and the other members of each file."""
    found = []
    for content in _files():
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            members = {name: archive.read(name) for name in archive.namelist()}
        described = np.load(io.BytesIO(members.pop("description.npy")))
        found.append((json.loads(described.tobytes()), members))
    return found


def archives(mutator):
    """Damaged files."""
    _read(mutator.bytes(_files()))
    return 1


def contents(mutator):
    """Whole archives whose description or arrays are changed."""
    description, members = mutator.pick(_members())
    if mutator.chance(0.7):
        description = mutator.plain(description)
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, data in members.items():
            archive.writestr(name, mutator.bytes([data]) if mutator.chance(0.2) else data)
        text = json.dumps(description, default=str).encode()
        array = io.BytesIO()
        np.save(array, np.frombuffer(text, np.uint8))
        archive.writestr("description.npy", array.getvalue())
    _read(buffer.getvalue())
    return 1


def _read(content):
    """Reads a policy and lets it act: its actions are finite and within bounds, or it refuses."""
    with contextlib.suppress(DataFileError, CommandError):
        policy = policy_from_bytes(content)
        size = policy.network.input_size
        if size <= _MAX_INPUTS:
            for value in (0.0, 1.0, -1e30):
                action = policy.act(np.full(size, value, np.float32))
                assert np.isfinite(action).all()
                assert action.dtype == np.int64 or (np.abs(action) <= 1.0).all()
