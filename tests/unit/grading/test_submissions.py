"""Submissions as files and folders, and what is refused."""

from __future__ import annotations

import pytest

from volery.core.errors import ScenarioError
from volery.grading import submissions
from volery.grading.submissions import SubmissionError, find_submissions


@pytest.fixture
def folder(tmp_path):
    """Returns a folder of submissions."""
    found = tmp_path / "submissions"
    (found / "bob").mkdir(parents=True)
    (found / "bob" / "submission.py").write_text("import helper\n")
    (found / "bob" / "helper.py").write_text("")
    (found / "ann-marie.py").write_text("x = 1\n")
    (found / "_template.py").write_text("")
    (found / "readme.txt").write_text("")
    return found


def test_files_and_folders_are_submissions(folder):
    assert [each.name for each in find_submissions(folder)] == ["ann-marie", "bob"]
    assert [each.name for each in find_submissions(folder / "ann-marie.py")] == ["ann-marie"]
    assert [each.name for each in find_submissions(folder / "bob")] == ["bob"]


def test_a_copy_has_the_module_and_what_is_beside_it(folder, tmp_path):
    ann, bob = find_submissions(folder)
    for submission in (ann, bob):
        target = tmp_path / submission.name
        target.mkdir()
        submission.copy_to(target)
    assert (tmp_path / "ann-marie" / "submission.py").read_text() == "x = 1\n"
    assert sorted(path.name for path in (tmp_path / "bob").iterdir()) == [
        "helper.py",
        "submission.py",
    ]


def test_links_are_refused(folder, tmp_path):
    secret = tmp_path / "secret.py"
    secret.write_text("")
    (folder / "link.py").symlink_to(secret)
    (folder / "bob" / "data").symlink_to(tmp_path)
    (folder / "linked").symlink_to(folder / "bob", target_is_directory=True)
    for submission in find_submissions(folder)[1:]:
        with pytest.raises(SubmissionError, match="symbolic link"):
            submission.copy_to(tmp_path / "work")


def test_large_submissions_are_refused(folder, tmp_path, monkeypatch):
    (_, bob) = find_submissions(folder)
    monkeypatch.setattr(submissions, "MAX_BYTES", 3)
    with pytest.raises(SubmissionError, match="larger than"):
        bob.copy_to(tmp_path / "work")
    monkeypatch.setattr(submissions, "MAX_FILES", 1)
    with pytest.raises(SubmissionError, match="more than 1 files"):
        bob.copy_to(tmp_path / "work")


def test_a_folder_needs_the_module(folder, tmp_path):
    (folder / "bob" / "submission.py").rename(folder / "bob" / "main.py")
    with pytest.raises(SubmissionError, match=r"no submission\.py"):
        find_submissions(folder)[1].copy_to(tmp_path / "work")


def test_two_of_one_name_and_none_are_errors(folder, tmp_path):
    (folder / "bob.py").write_text("")
    with pytest.raises(ScenarioError, match="two submissions are called 'bob'"):
        find_submissions(folder)
    (tmp_path / "empty").mkdir()
    with pytest.raises(ScenarioError, match="no submissions"):
        find_submissions(tmp_path / "empty")
    with pytest.raises(ScenarioError, match="no such file"):
        find_submissions(tmp_path / "nowhere")
