"""Runs the tutorials and writes their pictures.

Run as `python tools/site/tutorial_pictures.py`.
"""

from __future__ import annotations

import shutil
import tempfile
from pathlib import Path

import tutorial

_DOCS = Path(__file__).resolve().parents[2] / "docs"

if __name__ == "__main__":
    for page in sorted((_DOCS / "tutorials").glob("*.md")):
        if page.stem == "index":
            continue
        with tempfile.TemporaryDirectory() as folder:
            print(tutorial.run(page, Path(folder)), end="")
            for picture in sorted(Path(folder).glob("*.png")):
                shutil.copy(picture, _DOCS / "pictures")
