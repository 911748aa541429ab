"""What the README promises: its script runs, its commands exist, its links lead somewhere."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def blocks(language):
    return re.findall(rf"```{language}\n(.*?)```", README, flags=re.DOTALL)


def test_the_first_commands_are_run_and_test():
    (first, *_) = blocks("sh")
    lines = [line for line in first.splitlines() if line.startswith("make")]
    commands = [line.split("#")[0].strip() for line in lines]
    assert commands == ["make run", "make test"]


def test_every_make_target_named_exists():
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    for target in re.findall(r"(?:^|`)make ([a-z-]+)", README, flags=re.MULTILINE):
        assert re.search(rf"^{target}:", makefile, flags=re.MULTILINE), target


def test_the_script_runs_and_is_ten_lines(tmp_path):
    (script,) = blocks("python")
    assert len(script.strip().splitlines()) <= 10
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", script],
        check=False,
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=900,
    )
    assert done.returncode == 0, done.stderr
    assert "LANDED" in done.stdout


def test_the_volery_commands_exist():
    named = set(re.findall(r"^volery ([a-z]+)", "\n".join(blocks("sh")), flags=re.MULTILINE))
    assert {"run", "list", "info", "bench", "doctor"} <= named
    helped = subprocess.run(
        [sys.executable, "-m", "volery", "--help"], capture_output=True, text=True, check=True
    ).stdout
    for command in named:
        assert command in helped


@pytest.mark.slow
def test_the_volery_commands_run_as_they_stand(tmp_path):
    lines = "\n".join(blocks("sh")).splitlines()
    commands = [line.split("#")[0].split() for line in lines if line.startswith("volery ")]
    # those that open bridges or go through them: test_run_with_bridges.py
    commands = [c for c in commands if "--bridge" not in c and c[1] not in ("topic", "service")]
    assert len(commands) >= 7
    for command in commands:
        added = ["--exit-at-end"] if "--page" in command else []
        added += ["--quick"] if command[1] == "bench" else []
        done = subprocess.run(
            [sys.executable, "-m", "volery", *command[1:], *added],
            check=False,
            cwd=tmp_path,
            capture_output=True,
            text=True,
        )
        assert done.returncode == 0, f"{' '.join(command)}\n{done.stdout}{done.stderr}"
        assert done.stdout.strip()
    assert (tmp_path / "flight.mcap").exists()
    assert (tmp_path / "report" / "index.html").exists()


def exists(path):
    """Whether a linked file exists, or `make docs` generates it."""
    script = ROOT / "tools" / "site" / f"{path.stem}_reference.py"
    return path.exists() or (path.parent == ROOT / "docs" / "reference" and script.exists())


def test_links_lead_somewhere():
    pages = [ROOT / "README.md", *(ROOT / "docs").glob("*.md")]
    for page in pages:
        text = page.read_text(encoding="utf-8")
        for target in re.findall(r"\]\(([^)#]+)[^)]*\)", text):
            if not target.startswith("http"):
                assert exists(page.parent / target), f"{page.name} -> {target}"
