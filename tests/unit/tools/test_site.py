"""The documentation site: generated pages are complete, links lead somewhere, quotes exist."""

import ast
import json
import os
import re
import shlex
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest
from typer.main import get_command

from volery.cli.app import app
from volery.scenario import library

ROOT = Path(__file__).parents[3]
DOCS = ROOT / "docs"
REFERENCE = DOCS / "reference"
TOOLS = ROOT / "tools" / "site"
PAGES = [*DOCS.rglob("*.md"), *ROOT.glob("*.md")]


def generated_names():
    """The names that the hook registers; it needs mkdocs, which these tests do without."""
    for node in ast.parse((TOOLS / "generated_pages.py").read_text(encoding="utf-8")).body:
        if isinstance(node, ast.Assign) and node.targets[0].id == "GENERATED":
            return ast.literal_eval(node.value)
    raise AssertionError("no GENERATED")


GENERATED = generated_names()
GENERATED_PAGES = {f"reference/{name}.md" for name in GENERATED}


@cache
def generated_pages():
    """The texts of all generated pages: a process makes them, whose survey of graphs they share."""
    lines = (
        f"import json, sys; sys.path.insert(0, {str(TOOLS)!r})",
        "from importlib import import_module",
        f"pages = {{name: import_module(name + '_reference').page() for name in {GENERATED!r}}}",
        "print(json.dumps(pages))",
    )
    command = [sys.executable, "-c", "\n".join(lines)]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    return json.loads(done.stdout.splitlines()[-1])


def generated(name):
    return generated_pages()[name]


def links(text):
    """The relative links of a page and their anchors."""
    text = re.sub(r"^```.*?^```", "", text, flags=re.S | re.M)
    for target, anchor in re.findall(r"\]\(([^)#\s]*)(?:#([^)\s]*))?[^)]*\)", text):
        if "://" not in target and not target.startswith("mailto:"):
            yield target, anchor


def leads_somewhere(folder, target):
    path = Path(os.path.normpath(folder / target))
    known = path.is_relative_to(DOCS) and path.relative_to(DOCS).as_posix() in GENERATED_PAGES
    return known or path.exists()


@pytest.mark.slow
@pytest.mark.parametrize("name", GENERATED)
def test_generated_page(name):
    text = generated(name)
    assert text.startswith("# ")
    assert text.endswith("\n")
    for target, _ in links(text):
        assert leads_somewhere(REFERENCE, target), target


def test_git_holds_no_generated_page():
    """Reading a stale copy is worse than running `make docs`."""
    assert not [page for page in GENERATED_PAGES if (DOCS / page).exists()]


@pytest.mark.slow
def test_gallery_has_every_shipped_scenario():
    titles = re.findall(r"^## (\w+)$", generated("gallery"), flags=re.MULTILINE)
    assert titles == list(library.names())


@pytest.mark.slow
@pytest.mark.parametrize("name", ["topics", "services"])
def test_types_of_topics_and_services_are_in_the_reference_of_messages(name):
    anchors = set(re.findall(r"\{ #([\w-]+) \}", generated("messages")))
    used = {
        anchor for target, anchor in links(generated(name)) if target == "messages.md" and anchor
    }
    assert len(used) > 5
    assert used <= anchors


@pytest.mark.slow
def test_every_sensor_has_its_topics():
    section = generated("topics").partition("\n## Sensors\n")[2].partition("\n## ")[0]
    parts = dict(re.findall(r"^### `(\w+)`\n(.*?)(?=^### |\Z)", section, flags=re.S | re.M))
    assert {"lidar", "camera", "imu", "gnss", "sonar"} <= set(parts)
    for kind, table in parts.items():
        assert "| `/uavN/" in table, kind


def options_of(command, path=""):
    """(command, option) of a command and those below it."""
    for parameter in command.params:
        names = [*parameter.opts, *parameter.secondary_opts]
        yield from ((path, name) for name in names if name.startswith("--"))
    for name, each in getattr(command, "commands", {}).items():
        yield from options_of(each, f"{path} {name}".strip())


def documented_options(text):
    """(command, option) of the reference of the command line."""
    for section in re.split(r"^#{2,} `volery ", text, flags=re.MULTILINE)[1:]:
        path = section.partition("`")[0]
        for line in re.findall(r"^\* `(--?[^`]*)`", section, flags=re.MULTILINE):
            yield from ((path, name) for name in re.findall(r"--[a-z0-9-]+", line))


@pytest.mark.slow
def test_reference_of_the_command_line_has_every_option():
    text = generated("cli")
    options = {pair for pair in options_of(get_command(app)) if pair[0]}
    documented = {pair for pair in documented_options(text) if pair[1] != "--help"}
    assert documented == {pair for pair in options if pair[1] != "--help"}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_relative_links_lead_somewhere(page):
    for target, _ in links(page.read_text(encoding="utf-8")):
        assert leads_somewhere(page.parent, target), target


def test_every_page_is_in_the_navigation_once():
    nav = (ROOT / "mkdocs.yml").read_text(encoding="utf-8").partition("\nnav:\n")[2]
    named = re.findall(r"(\S+\.md)$", nav, flags=re.MULTILINE)
    assert len(named) == len(set(named))
    own = {page.relative_to(DOCS).as_posix() for page in DOCS.rglob("*.md")}
    assert {name for name in named if not name.startswith("project/")} == own | GENERATED_PAGES


def test_site_asks_no_other_host():
    """Styles, scripts and configuration load nothing from a network."""
    config = (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
    assert "font: false" in config
    assert "offline" in config
    for file in [ROOT / "mkdocs.yml", *(DOCS / "assets").iterdir()]:
        text = file.read_text(encoding="utf-8")
        hosts = re.findall(r"https?://[^\s\"'`)]+", text)
        assert {host for host in hosts if "www.w3.org" not in host} == set(), file.name


def messages_in_sources():
    """All texts of the sources; a hole stands for each inserted value."""
    found = set()
    for path in (ROOT / "src" / "volery").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.JoinedStr):
                found.add(
                    "".join(
                        part.value if isinstance(part, ast.Constant) else "{}"
                        for part in node.values
                    )
                )
            elif isinstance(node, ast.Constant) and isinstance(node.value, str):
                found.add(node.value)
    return found


def quoted_messages():
    text = (DOCS / "troubleshooting.md").read_text(encoding="utf-8")
    found = re.findall(r"^### (`+)(.+)\1$", text, flags=re.MULTILINE)
    return [message.strip() for _, message in found]


def test_every_message_of_the_troubleshooting_page_is_in_the_sources():
    sources = messages_in_sources()
    for message in quoted_messages():
        template = re.sub(r"<[^>]+>", "{}", message)
        assert any(template in text for text in sources), message


def test_troubleshooting_quotes_messages():
    assert len(quoted_messages()) >= 15


def test_every_public_name_is_in_the_reference_of_python():
    import volery
    from volery.core import errors

    named = "\n".join(page.read_text(encoding="utf-8") for page in (REFERENCE / "api").glob("*.md"))
    shown = set(re.findall(r"^::: [\w.]*\b(\w+)$", named, flags=re.MULTILINE))
    assert "errors" in shown  # all errors of this module
    assert {name for name in volery.__all__ if name not in vars(errors)} <= shown


def test_equations_are_tex_between_dollars():
    """An odd dollar would show the rest of a page as an equation."""
    for page in DOCS.rglob("*.md"):
        text = re.sub(r"^```.*?^```|`[^`\n]*`", "", page.read_text("utf-8"), flags=re.S | re.M)
        assert text.count("$") % 2 == 0, page.name


def commands_of(text):
    """The commands of volery in a document, as words."""
    text = text.replace("\\\n", " ")
    lines = re.findall(r"`(volery [^`\n]+)`", text)
    lines += re.findall(r"^\s*(?:\.venv/bin/)?(volery [^\n]+)$", text, flags=re.MULTILINE)
    for line in lines:
        yield shlex.split(line, comments=True)[1:]


@cache
def command_line():
    return get_command(app)


def unknown_parts(words):
    """The words of a command that the command line does not know."""
    command = command_line()
    while words and words[0] in getattr(command, "commands", {}):
        command, words = command.commands[words[0]], words[1:]
    if hasattr(command, "commands") and words and not words[0].startswith("-"):
        return [] if words[0].isupper() else [words[0]]  # upper case: `volery COMMAND --help`
    known = {name for option in command.params for name in (*option.opts, *option.secondary_opts)}
    options = {word.partition("=")[0] for word in words if word.startswith("--")}
    return sorted(options - known - {"--help", "--traceback"})


def test_commands_of_documents_exist():
    found = [(page, words) for page in PAGES for words in commands_of(page.read_text("utf-8"))]
    wrong = [(page.name, words) for page, words in found if unknown_parts(words)]
    assert wrong == []
    assert len(found) > 200


def test_an_unknown_command_is_found():
    (words,) = commands_of("Open it: `volery play flight.mcap --page`.")
    assert unknown_parts(words) == ["--page"]
    assert unknown_parts(["fly", "hover"]) == ["fly"]
