"""Hook of the documentation site: links to files of the repository outside `docs/`.

Documents link to each other and to files of the repository by relative paths, as on the web pages
of a git server. For each linked file outside `docs/` the site gets a page: Markdown as it is, other
text as a listing, a folder as a list of its files; pictures are copied. So no link of the site
leads out of it, and it is complete without a network.
"""

from __future__ import annotations

import os
import posixpath
import re
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
PROJECT = {
    "CHANGELOG.md": "project/changelog.md",
    "CODE_OF_CONDUCT.md": "project/code_of_conduct.md",
    "CONTRIBUTING.md": "project/contributing.md",
    "LICENSE": "project/license.md",
    "NOTICE": "project/notice.md",
    "README.md": "project/readme.md",
    "RELEASING.md": "project/releasing.md",
    "SECURITY.md": "project/security.md",
}
"""Files of the repository's root that are pages of the site."""
_LINK = re.compile(r"(\]\()([^)#\s]+)((?:#[^)]*)?\))")
_PICTURES = (".jpg", ".png", ".svg")
_LANGUAGES = {".py": "python", ".toml": "toml", ".xml": "xml", ".rviz": "yaml", ".yml": "yaml"}


def on_files(files: Files, config: Any) -> Files:
    """Adds pages for the project's files and for all files that documents link to."""
    waiting = [ROOT / name for name in PROJECT if (ROOT / name).is_file()]
    pages = [(file.src_uri, file.content_string) for file in files.documentation_pages()]
    waiting += [path for page, text in sorted(pages) for path in _linked(DOCS / page, text)]
    added: set[Path] = set()
    while waiting:
        path = waiting.pop()
        if path in added or _is_in_site(path):
            continue
        added.add(path)
        if path.suffix in _PICTURES:
            files.append(File.generated(config, page_of(path), abs_src_path=str(path)))
            continue
        files.append(File.generated(config, page_of(path), content=_content(path)))
        if path.is_dir():
            waiting += _files_of(path)
        elif path.suffix == ".md":
            waiting += _linked(path, path.read_text(encoding="utf-8"))
    return files


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Replaces relative links to files of the repository by links to their pages."""
    source = _source_of(page.file.src_uri)

    def replaced(match: re.Match[str]) -> str:
        target = _target(source, match[2])
        if target is None:
            return match[0]
        start = posixpath.dirname(page.file.src_uri) or "."
        return f"{match[1]}{posixpath.relpath(page_of(target), start)}{match[3]}"

    return _LINK.sub(replaced, markdown)


def page_of(path: Path) -> str:
    """Returns the address of a file of the repository among the sources of the site."""
    if _is_in_site(path):
        return path.relative_to(DOCS).as_posix()
    name = path.relative_to(ROOT).as_posix()
    if name in PROJECT:
        return PROJECT[name]
    if path.is_dir():
        return f"source/{name}/index.md"
    return f"source/{name}" if path.suffix in (".md", *_PICTURES) else f"source/{name}.md"


def _source_of(page: str) -> Path:
    for name, address in PROJECT.items():
        if page == address:
            return ROOT / name
    if page.startswith("source/"):
        return ROOT / page.removeprefix("source/")  # of a folder: as if its list were in it
    return DOCS / page


def _target(source: Path, link: str) -> Path | None:
    if "://" in link or link.startswith(("mailto:", "/")):
        return None
    path = Path(os.path.normpath(source.parent / link))
    return path if path.exists() and path.is_relative_to(ROOT) else None


def _linked(page: Path, text: str) -> list[Path]:
    targets = (_target(page, link) for _, link, _ in _LINK.findall(text))
    return [target for target in targets if target is not None and not _is_in_site(target)]


def _is_in_site(path: Path) -> bool:
    """Returns whether MkDocs itself takes a file; scripts in `docs/` are excluded."""
    return path.is_relative_to(DOCS) and path.suffix != ".py"


def _files_of(folder: Path) -> list[Path]:
    return sorted(path for path in folder.iterdir() if path.suffix in _LANGUAGES)


def _content(path: Path) -> str:
    if path.is_dir():
        names = [file.name for file in _files_of(path)]
        title = f"# `{path.relative_to(ROOT).as_posix()}`\n\n"
        return title + "\n".join(f"- [`{name}`]({name})" for name in names) + "\n"
    text = path.read_text(encoding="utf-8")
    if path.suffix == ".md":
        return text
    language = _LANGUAGES.get(path.suffix, "text")
    return f"# `{path.relative_to(ROOT).as_posix()}`\n\n````{language}\n{text.rstrip()}\n````\n"
