"""Reads and writes policy files: `.npz` archives of at most 1 MB, without pickled objects.

The archive holds the weights as float32 arrays (`network` lists their names) and the member
`description`, UTF-8 bytes of JSON (`description.PolicyDescription`).
"""

from __future__ import annotations

import io
import json
import lzma
import math
import tokenize
import warnings
import zipfile
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import ValidationError

from volery.autonomy.policy.description import FORMAT, PolicyDescription
from volery.autonomy.policy.network import Network
from volery.core.errors import DataFileError
from volery.core.whole_files import write_whole
from volery.scenario.validation import describe_validation_error

MAX_FILE_BYTES = 1_000_000
_MAX_ARRAY_BYTES = 8_000_000
"""Of all arrays together, unpacked."""
_DESCRIPTION = "description"
_DAMAGE: tuple[type[Exception], ...] = (
    ArithmeticError,
    AttributeError,
    EOFError,
    LookupError,
    NotImplementedError,
    OSError,
    RuntimeError,
    SyntaxError,
    TypeError,
    ValueError,
    zipfile.BadZipFile,
    zipfile.LargeZipFile,
    zlib.error,
    lzma.LZMAError,
    tokenize.TokenError,
)
"""What zipfile and numpy raise for damaged files."""


@dataclass(frozen=True)
class Policy:
    """A policy: its description and the network that computes actions."""

    description: PolicyDescription
    network: Network

    def act(self, observation: ArrayLike) -> NDArray[Any]:
        """Returns actions as environments take them, for observations (..., D).

        Numbers from -1 to 1, (..., A), or choices (...). Raises `CommandError` for observations of
        another size or that are not finite, and for outputs that are not finite.
        """
        action = self.network.act(observation)
        if self.description.action.choices is None:
            return action
        return np.asarray(action[..., 0].astype(np.int64))


def make_policy(
    description: PolicyDescription | dict[str, Any], arrays: dict[str, NDArray[Any]]
) -> Policy:
    """Returns a policy of its description and its weights by name (see `network`).

    Raises `DataFileError` for weights that do not fit the description or are not finite.
    """
    if isinstance(description, dict):
        description = _described(description, "policy")
    return Policy(description, Network(description, arrays))


def write_policy(path: str | Path, policy: Policy) -> None:
    """Writes a policy file. Raises `DataFileError` for one beyond 1 MB, or without permission.

    The file appears complete or not at all, and equal policies give equal bytes.
    """
    text = json.dumps(policy.description.to_json(), indent=1)
    arrays = {_DESCRIPTION: np.frombuffer(text.encode(), np.uint8), **policy.network.arrays}
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **arrays)  # type: ignore[arg-type]  # names are keywords
    if buffer.tell() > MAX_FILE_BYTES:
        raise DataFileError(
            f"policy '{path}' has {buffer.tell()} bytes; at most {MAX_FILE_BYTES} are allowed: "
            "use smaller layers"
        )
    try:
        write_whole(path, buffer.getvalue())
    except OSError as error:
        raise DataFileError(f"policy '{path}' cannot be written: {error.strerror}") from None


def read_policy(path: str | Path) -> Policy:
    """Reads a policy file.

    Raises `DataFileError` with one line for a file that is missing, too large, damaged, of another
    format, or whose arrays do not fit its description.
    """
    where = f"policy '{path}'"
    try:
        with Path(path).open("rb") as file:
            content = file.read(MAX_FILE_BYTES + 1)
    except OSError as error:
        raise DataFileError(f"{where} cannot be read: {error.strerror}") from None
    return policy_from_bytes(content, where)


def policy_from_bytes(content: bytes, where: str = "policy") -> Policy:
    """Returns the policy of a file's bytes; `where` names it in errors. See `read_policy`."""
    if len(content) > MAX_FILE_BYTES:
        raise DataFileError(f"{where} is larger than {MAX_FILE_BYTES} bytes")
    try:
        arrays = _arrays(content)
    except _DAMAGE as error:
        reason = str(error).split("\n")[0] or type(error).__name__
        raise DataFileError(f"{where} is damaged, or not a policy file: {reason}") from None
    described = arrays.pop(_DESCRIPTION, None)
    if described is None or described.dtype != np.uint8:
        raise DataFileError(f"{where} has no description; is it a policy of `volery train`?")
    try:
        data = json.loads(described.tobytes())
    except (ValueError, RecursionError):
        raise DataFileError(f"{where}: its description is not JSON") from None
    description = _described(data, where)
    try:
        return Policy(description, Network(description, arrays))
    except DataFileError as error:
        raise DataFileError(f"{where}: {error}") from None


def _described(data: Any, where: str) -> PolicyDescription:
    number = data.get("format") if isinstance(data, dict) else None
    if number != FORMAT:
        raise DataFileError(f"{where} has format {number!r}; this version reads format {FORMAT}")
    try:
        return PolicyDescription.model_validate(data)
    except ValidationError as error:
        fault = describe_validation_error(error, where, PolicyDescription, data)
        raise DataFileError(fault.replace("\n ", ";")) from None


def _arrays(content: bytes) -> dict[str, NDArray[Any]]:
    """Returns the members of an archive. Raises errors of many kinds if it is damaged."""
    found = {}
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        members = archive.infolist()
        if sum(member.file_size for member in members) > _MAX_ARRAY_BYTES:
            raise ValueError(f"its arrays have more than {_MAX_ARRAY_BYTES} bytes")
        for member in members:
            with archive.open(member) as file:
                data = file.read(_MAX_ARRAY_BYTES)
            found[member.filename.removesuffix(".npy")] = _array(data)
    return found


def _array(data: bytes) -> NDArray[Any]:
    """Returns the array of a member whose header claims what the bytes hold."""
    file = io.BytesIO(data)
    version = np.lib.format.read_magic(file)
    if version != (1, 0):
        raise ValueError(f"array of version {version}")
    with warnings.catch_warnings():  # about headers of Python 2, which damage resembles
        warnings.simplefilter("ignore", UserWarning)
        shape, is_fortran, dtype = np.lib.format.read_array_header_1_0(file)
    start = file.tell()
    if dtype.hasobject or math.prod(shape) * dtype.itemsize != len(data) - start:
        raise ValueError("an array is incomplete")
    order: Literal["F", "C"] = "F" if is_fortran else "C"
    return np.frombuffer(data, dtype, offset=start).reshape(shape, order=order)
