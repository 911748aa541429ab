"""Policy files: written and read again, and every kind of damage in one line."""

from __future__ import annotations

import io
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from policy_making import description, image_policy, mlp, small_policy

from volery.autonomy.policy.policy_file import (
    make_policy,
    policy_from_bytes,
    read_policy,
    write_policy,
)
from volery.autonomy.policy.shipped_policies import find_policy
from volery.core.errors import CommandError, DataFileError


@pytest.mark.parametrize("policy", [small_policy(), image_policy()], ids=["mlp", "image"])
def test_a_policy_survives_its_file(tmp_path: Path, policy: Any) -> None:
    write_policy(tmp_path / "a.npz", policy)
    write_policy(tmp_path / "b.npz", policy)
    again = read_policy(tmp_path / "a.npz")
    assert again.description == policy.description
    x = np.linspace(-2.0, 2.0, policy.network.input_size)
    assert again.network.act(x).tobytes() == policy.network.act(x).tobytes()
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.npz", "b.npz"]


def test_a_cut_or_changed_file_is_one_error(tmp_path: Path) -> None:
    write_policy(tmp_path / "a.npz", small_policy())
    content = (tmp_path / "a.npz").read_bytes()
    for length in range(0, len(content), 97):
        with pytest.raises(DataFileError):
            policy_from_bytes(content[:length])
    rng = np.random.default_rng(0)
    for _ in range(300):
        changed = bytearray(content)
        for index in rng.integers(0, len(content), 3):
            changed[index] = int(rng.integers(256))
        policy = _read_or_none(bytes(changed))
        assert policy is None or np.isfinite(policy.network.act(np.zeros(6))).all()


def _read_or_none(content: bytes) -> Any:
    try:
        return policy_from_bytes(content)
    except DataFileError:
        return None


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"format": 2}, "format 2; this version reads format 1"),
        ({"surprise": 1}, "surprise"),
        ({"decision_rate_hz": -1.0}, "decision_rate_hz"),
        ({"observation": []}, "observation"),
        ({"action": {"kind": "velocity", "size": 0}}, "size"),
        ({"network": {"output": "argmax"}}, "argmax"),
        ({"network": {"images": [{"part": "x", "shape": [1, 2, 3], "strides": [1]}]}}, "'x'"),
        (
            {"network": {"images": [{"part": "goal_heading", "shape": [1, 2, 3], "strides": [1]}]}},
            "3 numbers",
        ),
    ],
)
def test_descriptions_that_do_not_fit_are_refused(changes: dict[str, Any], text: str) -> None:
    with pytest.raises(DataFileError, match=text):
        make_policy(description(**changes), mlp("policy", [6, 4], np.random.default_rng(0)))


def test_objects_and_lying_headers_are_refused() -> None:
    for array in (np.array([{"a": 1}], dtype=object),):
        buffer = io.BytesIO()
        np.savez(buffer, description=array)
        with pytest.raises(DataFileError, match="damaged"):
            policy_from_bytes(buffer.getvalue())
    header = io.BytesIO()
    np.lib.format.write_array_header_1_0(
        header, {"descr": "<f4", "fortran_order": False, "shape": (10**12,)}
    )
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        archive.writestr("policy.0.weight.npy", header.getvalue())
    with pytest.raises(DataFileError, match="incomplete"):
        policy_from_bytes(buffer.getvalue())


@pytest.mark.parametrize("end", ["(", "}", "'"])
def test_headers_that_cannot_be_parsed_are_refused(end: str) -> None:
    """numpy raises errors of other modules for some, and warns of a header of Python 2."""
    text = "{'descr': '<f4', 'fortran_order': False, 'shape': (1,), } " + end
    header = b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text.encode()
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        archive.writestr("policy.0.weight.npy", header + bytes(4))
    with pytest.raises(DataFileError, match="damaged"):
        policy_from_bytes(buffer.getvalue())


def test_outputs_that_overflow_are_refused() -> None:
    arrays = mlp("policy", [6, 8, 4], np.random.default_rng(0))
    large = {name: np.full_like(array, 3e38) for name, array in arrays.items()}
    policy = make_policy(description(), large)
    with pytest.raises(CommandError, match="not finite"):
        policy.act(np.ones(6))


def test_a_bomb_and_a_large_file_are_refused(tmp_path: Path) -> None:
    buffer = io.BytesIO()
    np.savez_compressed(buffer, description=np.zeros(20_000_000, np.uint8))
    with pytest.raises(DataFileError, match="more than 8000000 bytes"):
        policy_from_bytes(buffer.getvalue())
    (tmp_path / "large.npz").write_bytes(bytes(1_000_001))
    with pytest.raises(DataFileError, match="larger than"):
        read_policy(tmp_path / "large.npz")
    wide = make_policy(description(), mlp("policy", [6, 600, 600, 4], np.random.default_rng(0)))
    with pytest.raises(DataFileError, match="at most 1000000"):
        write_policy(tmp_path / "wide.npz", wide)


def test_a_missing_policy_names_those_that_ship(tmp_path: Path) -> None:
    with pytest.raises(DataFileError, match="no policy file"):
        find_policy(str(tmp_path / "nothing.npz"))
    with pytest.raises(DataFileError, match="no policy 'homming'"):
        find_policy("homming")
    with pytest.raises(DataFileError, match="cannot be read"):
        read_policy(tmp_path / "nothing.npz")
