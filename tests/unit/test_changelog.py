"""Tests the form of the changelog, and that commands, options and versions in it exist."""

import re
import tomllib
from datetime import date
from pathlib import Path

import pytest
import typer

from volery.cli.app import app

ROOT = Path(__file__).parents[2]
TEXT = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
VERSION = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]
SECTIONS = ["Highlights", "Added", "Changed", "Deprecated", "Removed", "Fixed", "Security"]
"""Those of Keep a Changelog, in its order, after the highlights."""


def releases() -> list[tuple[str, str]]:
    """Heading and content of each release, the newest first."""
    parts = re.split(r"^## (.*)$", TEXT, flags=re.MULTILINE)[1:]
    return list(zip(parts[::2], parts[1::2], strict=True))


def sections(content: str) -> dict[str, str]:
    parts = re.split(r"^### (.*)$", content, flags=re.MULTILINE)[1:]
    assert len(set(parts[::2])) == len(parts[::2])
    return dict(zip(parts[::2], parts[1::2], strict=True))


def test_the_newest_release_is_the_version_of_the_package():
    versions = [re.match(r"\[([\d.]+)\] - ", heading)[1] for heading, _ in releases()]
    assert versions[0] == VERSION
    assert versions == sorted(versions, key=lambda v: [int(n) for n in v.split(".")], reverse=True)


def test_only_the_newest_release_may_have_no_date():
    days = [heading.partition("] - ")[2] for heading, _ in releases()]
    if days[0] == "unreleased":
        days = days[1:]
    for day in days:
        assert re.fullmatch(r"\d{4}-\d\d-\d\d", day), day
    dates = [date.fromisoformat(day) for day in days]
    assert dates == sorted(dates, reverse=True)


@pytest.mark.parametrize(("heading", "content"), releases())
def test_sections_are_those_of_keep_a_changelog_in_order(heading, content):
    found = sections(content)
    assert list(found) == [name for name in SECTIONS if name in found], heading
    for name, text in found.items():
        assert re.search(r"^- ", text, re.MULTILINE), f"{heading}: {name} is empty"
        for line in text.splitlines():
            assert re.match(r"$|- |  \S|#### |[A-Z\[]", line), line
            assert len(line) <= 140, line


def test_a_release_begins_with_short_highlights():
    first = sections(releases()[0][1])["Highlights"]
    assert 3 <= len(re.findall(r"^- ", first, re.MULTILINE)) <= 10
    assert len(first.splitlines()) <= 30


def commands():
    return dict(typer.main.get_command(app).commands)


def test_commands_exist():
    named = set(re.findall(r"`volery ([a-z]\w*)", TEXT))
    assert len(named) > 10
    assert named <= commands().keys()


def test_options_exist():
    known = {"--version", "--json"}
    waiting = list(commands().values())
    while waiting:
        command = waiting.pop()
        waiting += getattr(command, "commands", {}).values()
        known |= {name for each in command.params for name in (*each.opts, *each.secondary_opts)}
    named = set(re.findall(r"`(?:[^`]* )?(--[a-z][\w-]*)", TEXT))
    assert len(named) > 10
    assert named <= known


def test_citation_names_the_same_version():
    text = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert re.search(r"^version: (.*)$", text, re.MULTILINE)[1] == VERSION
