"""`volery node`: what is wrong with the command is said before it waits for a graph."""

import pytest
from typer.testing import CliRunner

from volery.cli import node
from volery.cli.app import app

GAPS = "volery.autonomy.gap_following:GapFollowing"


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["no_such_module:Node"], "cannot be imported"),
        (["volery.autonomy.gap_following:Nobody"], "has no class 'Nobody'"),
        (["volery.autonomy.gap_following:Phase"], "is no subclass of volery.graph.node.Node"),
        ([GAPS, "--lock-step", "0"], "lock-step"),
        ([GAPS, "--lock-step", "-1"], "lock-step"),
        ([GAPS, "--lock-step", "nan"], "lock-step"),
        ([GAPS, "--lock-step", "inf"], "lock-step"),
    ],
)
def test_a_command_that_cannot_run_does_not_wait(words, told, monkeypatch):
    def wait(*_):
        raise AssertionError("it waits for a graph")

    monkeypatch.setattr(node, "await_link", wait)
    result = CliRunner().invoke(app, ["node", *words])
    assert result.exit_code == 2, result.output
    assert told in result.output
