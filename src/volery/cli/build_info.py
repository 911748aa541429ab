"""Describes the installed build: version, git commit, Python, platform, page, libraries."""

from __future__ import annotations

import json
import platform
from dataclasses import asdict, dataclass
from pathlib import Path

from volery.cli.commit import Commit, find_commit
from volery.core.machine import describe_versions

_PACKAGE = Path(__file__).parents[1]
_CHECKOUT = _PACKAGE.parents[1]
_RECORDED_COMMIT = _PACKAGE / "build_commit.json"
_PAGE = _PACKAGE / "server/static/index.html"


@dataclass(frozen=True)
class BuildInfo:
    """Describes a build. `commit` is None if unknown; `libraries` maps names to versions."""

    version: str
    commit: Commit | None
    python: str
    platform: str
    has_page: bool
    libraries: dict[str, str]

    def to_json(self) -> str:
        """Returns the fields as one JSON object; `commit` is null or has `id`, `is_changed`."""
        return json.dumps(asdict(self), indent=2)

    def __str__(self) -> str:
        commit = f" ({self.commit})" if self.commit else ""
        libraries = ", ".join(f"{name} {found}" for name, found in self.libraries.items())
        return (
            f"volery {self.version}{commit}\n"
            f"Python {self.python} on {self.platform}\n"
            f"{libraries}\n"
            f"page {'built' if self.has_page else 'not built: run `make web` in a clone'}"
        )


def describe_build() -> BuildInfo:
    """Returns the build that runs this function."""
    libraries = describe_versions()
    return BuildInfo(
        version=libraries.pop("volery"),
        commit=find_commit(_CHECKOUT, _RECORDED_COMMIT),
        python=libraries.pop("python"),
        platform=platform.platform(),
        has_page=_PAGE.is_file(),
        libraries=libraries,
    )
