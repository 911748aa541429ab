"""The source distribution holds what `make docs` needs."""

import subprocess
import sys
import tarfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.mark.slow
def test_source_distribution_holds_the_site(tmp_path):
    subprocess.run(
        [sys.executable, "-m", "build", "--sdist", "--outdir", str(tmp_path), str(ROOT)],
        check=True,
        capture_output=True,
    )
    (source,) = tmp_path.glob("*.tar.gz")
    with tarfile.open(source) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    site = [ROOT / "mkdocs.yml", *(ROOT / "docs").rglob("*"), *(ROOT / "tools/site").glob("*.py")]
    needed = {path.relative_to(ROOT).as_posix() for path in site if path.is_file()}
    assert {name for name in needed if "__pycache__" not in name} <= names
    assert not any(name.startswith("build/") for name in names)
