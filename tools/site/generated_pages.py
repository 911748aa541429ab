"""Hook of the documentation site: pages of the reference that the code itself describes.

The page `reference/NAME.md` is the text that `page()` of `NAME_reference.py` returns. Git holds
none of these pages, so none can be out of date; `python tools/site/NAME_reference.py` prints one.
A new page needs its script, its name in `GENERATED` and a line below `nav` in `mkdocs.yml`.
"""

from __future__ import annotations

from functools import cache
from importlib import import_module
from typing import Any

from mkdocs.structure.files import File, Files

GENERATED = ("cli", "gallery", "messages", "scenario", "services", "topics")
_SCRIPTS = {name: import_module(f"{name}_reference") for name in GENERATED}


def on_files(files: Files, config: Any) -> Files:
    """Adds the generated pages."""
    for name in GENERATED:
        files.append(File.generated(config, f"reference/{name}.md", content=_text(name)))
    return files


@cache
def _text(name: str) -> str:
    return str(_SCRIPTS[name].page())
