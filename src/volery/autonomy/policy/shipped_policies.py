"""Finds policies: those that ship with Volery by name, others by path."""

from __future__ import annotations

from pathlib import Path

from volery.autonomy.policy.policy_file import Policy, read_policy
from volery.core.errors import DataFileError
from volery.core.near_names import near_miss

_FOLDER = Path(__file__).resolve().parents[2] / "learning" / "baselines"


def shipped_policies() -> list[str]:
    """Returns the names of the policies that ship, sorted."""
    return sorted(path.stem for path in _FOLDER.glob("*.npz"))


def find_policy(name: str, folder: Path | None = None) -> Path:
    """Returns the file of a policy: a shipped name, or a path (in `folder` or as given) to `.npz`.

    Raises `DataFileError`, listing the shipped names, if there is none.
    """
    if name.endswith(".npz"):
        for path in ((folder or Path()) / name, Path(name)):
            if path.is_file():
                return path
        raise DataFileError(f"no policy file '{name}'")
    known = shipped_policies()
    if name in known:
        return _FOLDER / f"{name}.npz"
    hint = near_miss(name, known)
    listed = ", ".join(known) or "none ship"
    raise DataFileError(f"no policy '{name}'{hint} Known: {listed}, or the path of a .npz file")


def load_policy(name: str, folder: Path | None = None) -> Policy:
    """Reads a policy by name or path. Raises `DataFileError`; see `find_policy`, `read_policy`."""
    return read_policy(find_policy(name, folder))
