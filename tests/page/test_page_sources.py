"""What the page is built from agrees with the rest of the project."""

import json
import subprocess
import sys
from pathlib import Path

WEB = Path(__file__).parents[2] / "web"


def test_message_types_are_those_of_the_definitions():
    written = (WEB / "src/messages/generated.ts").read_text()
    hint = "python tools/typescript_messages.py > web/src/messages/generated.ts"
    # in a process that knows no types of other tests
    words = [sys.executable, WEB.parent / "tools" / "typescript_messages.py"]
    generated = subprocess.run(
        words, check=True, capture_output=True, text=True, timeout=900
    ).stdout
    assert written.strip() == generated.strip(), hint


def test_lock_file_names_no_registry():
    lock = json.loads((WEB / "package-lock.json").read_text())
    packages = {name: entry for name, entry in lock["packages"].items() if name}
    assert len(packages) > 50
    assert [name for name, entry in packages.items() if "resolved" in entry] == []
    assert [name for name, entry in packages.items() if "integrity" not in entry] == []
    assert "http" not in {part.partition(":")[0] for part in packages}


def test_page_asks_no_other_host():
    """Nothing in the sources names a host; the page's address is all it knows."""
    foreign = []
    for source in (WEB / "src").rglob("*.ts*"):
        if source.stem.endswith(".test"):  # not part of the page
            continue
        for line in source.read_text().splitlines():
            code = line.partition("//")[0] if "://" not in line else line
            if "http://" in code or "https://" in code:
                foreign.append(f"{source.name}: {line.strip()}")
    assert foreign == []
