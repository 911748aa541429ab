"""Where the page of a run is served."""

import socket

import pytest
from typer.testing import CliRunner

from volery.cli import run, serve
from volery.cli.app import app
from volery.cli.flight import RunOptions
from volery.cli.pages import _is_taken, _settings_of
from volery.core.errors import CommandError


@pytest.fixture
def page_of(monkeypatch):
    """What `volery run` makes of its words."""

    def asked(*words):
        found = []
        monkeypatch.setattr(run, "fly", lambda options: found.append(options) or 0)
        result = CliRunner().invoke(app, ["run", *words])
        assert result.exit_code == 0, result.output
        return found[0]

    return asked


@pytest.mark.parametrize(
    ("words", "page", "speed"),
    [
        (["hover"], None, None),
        (["hover", "--page"], "", 1.0),
        (["--page", "hover"], "", 1.0),
        (["hover", "--page=127.0.0.1:8081", "--speed", "2"], "127.0.0.1:8081", 2.0),
        (["hover", "--page", "--bridge", "rosbridge"], "", 1.0),
        (["--page", "8091", "hover"], "8091", 1.0),
        (["hover", "--page", "[::1]:8091"], "[::1]:8091", 1.0),
        (["hover", "--port", "8091"], "8091", 1.0),
        (["hover", "--port=8091"], "8091", 1.0),
    ],
)
def test_the_option_and_its_value_that_may_be_left_away(page_of, words, page, speed):
    options = page_of(*words)
    assert (options.scenario, options.page, options.speed) == ("hover", page, speed)


def test_a_value_that_contains_the_option_is_kept(page_of):
    assert page_of("hover", "--record=my--port=1.mcap").record.name == "my--port=1.mcap"


@pytest.mark.parametrize(
    ("words", "host", "port"),
    [
        (["--port", "8091"], "127.0.0.1", 8091),
        (["--page=8091"], "127.0.0.1", 8091),
        (["--page", "8091"], "127.0.0.1", 8091),
        (["--page=[::1]:8091"], "::1", 8091),
        (["--host", "::1", "--page", "--port=8091"], "::1", 8091),
    ],
)
def test_serve_takes_the_option_of_run(monkeypatch, words, host, port):
    found = []
    monkeypatch.setattr(serve, "serve", lambda options: found.append(options.page))
    result = CliRunner().invoke(app, ["serve", "hover", *words])
    assert result.exit_code == 0, result.output
    assert (found[0].host, found[0].port) == (host, port)


@pytest.mark.parametrize(
    ("words", "bridges", "domain", "interfaces"),
    [
        (["--ros2"], ("ros2",), None, ()),
        (["--ros2", "--domain-id", "7"], ("ros2",), 7, ()),
        (["--ros2", "--middleware", "zenoh"], ("ros2-zenoh",), None, ()),
        (
            ["--bridge", "ros1", "--ros2", "--ros2-interface", "eth0"],
            ("ros1", "ros2"),
            None,
            ("eth0",),
        ),
    ],
)
def test_ros2_is_a_bridge_with_options_of_its_own(page_of, words, bridges, domain, interfaces):
    options = page_of("hover", *words)
    assert (options.bridges, options.domain_id, options.interfaces) == (bridges, domain, interfaces)
    assert options.speed == 1.0


@pytest.mark.parametrize(
    ("page", "host", "port"),
    [("8081", "127.0.0.1", 8081), ("0.0.0.0:80", "0.0.0.0", 80), ("[::1]:0", "::1", 0)],
)
def test_addresses(page, host, port):
    settings = _settings_of(RunOptions("hover", page=page, token="t", allow_remote=True))
    assert (settings.host, settings.port) == (host, port)
    assert settings.anywhere
    assert settings.tokens.operator == "t"


@pytest.mark.parametrize("page", ["x", "host:", ":80", "1:70000"])
def test_what_is_no_address(page):
    with pytest.raises(CommandError, match="PORT or HOST:PORT"):
        _settings_of(RunOptions("hover", page=page))


def test_a_taken_port_gives_way(monkeypatch, capsys):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        assert _is_taken("127.0.0.1", port)
    assert not _is_taken("127.0.0.1", port)
    monkeypatch.setattr("volery.cli.pages._is_taken", lambda _host, _port: True)
    assert _settings_of(RunOptions("hover", page="")).port == 0
    assert "is taken; the page takes a free one" in capsys.readouterr().err
    monkeypatch.setattr("volery.cli.pages._is_taken", lambda _host, _port: False)
    assert _settings_of(RunOptions("hover", page="")).port == 8080


@pytest.mark.parametrize(("taken", "port"), [(False, 8080), (True, 0)])
def test_serve_and_run_take_the_same_port(monkeypatch, taken, port):
    """The default port gives way, a port that was asked for does not."""
    found = []
    monkeypatch.setattr("volery.cli.pages._is_taken", lambda _host, _port: taken)
    monkeypatch.setattr("volery.cli.serve.serve", found.append)
    for words in ((), ("--port", "8099")):
        result = CliRunner().invoke(app, ["serve", *words])
        assert result.exit_code == 0, result.output
    assert _settings_of(RunOptions(scenario="hover", page="")).port == port
    assert [options.page.port for options in found] == [port, 8099]
