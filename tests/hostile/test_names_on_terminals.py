"""Names that logs and clients give: they neither act on a terminal nor make lines of their own."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from volery.cli import tables
from volery.cli.app import app
from volery.cli.error_reporting import _LogFormatter, complain, warn
from volery.cli.node_logs import _Terminal
from volery.cli.progress import FlightProgress
from volery.core.plain_text import plain, plain_message

EVIL = "a\x1b]0;title\x07\x9b2J\nerror: forged\r\u202ereversed"
SPELLED = r"a\x1b]0;title\x07\x9b2J\nerror: forged\r\u202ereversed"


def test_plain_text_stays_as_it_is() -> None:
    for text in ("", "plain", "Ärger über 3 m²", "日本語", "1\u00a0234", "🛩"):
        assert plain(text) == text
        assert plain_message(text) == text


def test_what_acts_on_a_terminal_is_spelled_out() -> None:
    assert plain(EVIL) == SPELLED
    assert plain("\ud800\u2028\x7f") == r"\ud800\u2028\x7f"
    assert plain("two\nlines\x1b", "\n") == "two\nlines\\x1b"


def test_a_foreign_line_begins_no_message() -> None:
    assert plain_message("first\n second\nerror: forged") == "first\n second\\nerror: forged"


def test_info_shows_a_foreign_log(tmp_path: Path) -> None:
    path = _log(tmp_path / "foreign.mcap")
    result = CliRunner().invoke(app, ["info", str(path)])
    assert result.exit_code == 0
    assert SPELLED in result.stdout
    assert result.stdout.count(r"\x1b") == 2  # topic and schema
    _check(result.stdout)


def test_tables_errors_warnings_and_logs(capsys: pytest.CaptureFixture[str]) -> None:
    tables.print_table(("name", EVIL), [(EVIL, "1")])
    complain(EVIL)
    warn(EVIL)
    record = logging.LogRecord("volery", logging.WARNING, "", 0, "client %s", (EVIL,), None)
    assert _LogFormatter().format(record) == f"warning: client {SPELLED}"
    _Terminal().emit(record)
    with FlightProgress(EVIL, 1.0) as progress:
        progress.update(0.5, 1.0, paused=True)
    out, err = capsys.readouterr()
    assert out.count(SPELLED) >= 3
    assert err.count(SPELLED) == 3
    _check(out + err)


def test_tables_on_a_terminal(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "200")
    monkeypatch.setattr("sys.stdout.isatty", lambda: True)
    tables.print_table(("name",), [(EVIL,)])
    out = capsys.readouterr().out
    assert SPELLED in out


def _check(text: str) -> None:
    assert not [line for line in text.splitlines() if line.startswith("error: forged")]
    assert all(letter.isprintable() or letter == "\n" for letter in text)


def _log(path: Path) -> Path:
    from mcap.writer import Writer

    with path.open("wb") as file:
        writer: Any = Writer(file)
        writer.start()
        schema = writer.register_schema(f"std_msgs/msg/{EVIL}", "ros2msg", b"string data")
        channel = writer.register_channel(f"/{EVIL}", "cdr", schema)
        writer.add_message(channel, 1, b"\0\1\0\0\1\0\0\0\0", 1)
        writer.finish()
    return path
