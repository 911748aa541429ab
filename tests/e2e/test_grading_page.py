"""The document on grading: its files and commands as they stand."""

import json
import re
import subprocess
import sys
from pathlib import Path

PAGE = Path(__file__).parents[2] / "docs" / "grading.md"
FILE = re.compile(r"^```\w+\n# (course/[\w/.]+)\n(.*?)^```", re.DOTALL | re.MULTILINE)


def test_the_course_of_the_document_is_graded(tmp_path):
    text = PAGE.read_text("utf-8")
    files = dict(FILE.findall(text))
    assert sorted(Path(name).name for name in files) == ["across.toml", "ann.py", "assignment.toml"]
    for name, content in files.items():
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        # a loaded machine may need longer than the document allows
        path.write_text(content.replace("timeout_s = 60.0", "timeout_s = 600.0"), encoding="utf-8")
    command = re.search(r"^volery (grade course/assignment.toml course/submissions.*)$", text, re.M)
    assert command is not None
    done = subprocess.run(
        [sys.executable, "-m", "volery", *command[1].split(), "--json"],
        cwd=tmp_path,
        capture_output=True,
        check=True,
        text=True,
        timeout=900.0,
    )
    (graded,) = json.loads(done.stdout)["grades"]
    assert (graded["submission"], graded["total"], graded["max_total"]) == ("ann", 6.0, 6.0)
    assert [flight["seed"] for flight in graded["flights"]] == [4711, 4712, 4713]
    assert (tmp_path / "grades.csv").read_text().startswith("submission,points,of,")
    assert "<summary>ann</summary>" in (tmp_path / "grades.html").read_text()
