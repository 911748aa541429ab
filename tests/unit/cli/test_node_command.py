"""`volery node`: what is wrong with the command is said before it waits for a graph."""

import pytest
from typer.testing import CliRunner

from volery.cli import launch, node
from volery.cli.app import app

GAPS = "gap_following"


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["no_such_module:Node"], "cannot be imported"),
        (["volery.autonomy.avoidance.gap_following:Nobody"], "has no class 'Nobody'"),
        (
            ["volery.autonomy.avoidance.gap_following:GapFollowingPhase"],
            "is no subclass of volery.graph.nodes.node.Node",
        ),
        ([GAPS, "--lock-step", "0"], "lock-step"),
        ([GAPS, "--lock-step", "-1"], "lock-step"),
        ([GAPS, "--lock-step", "nan"], "lock-step"),
        ([GAPS, "--lock-step", "inf"], "lock-step"),
        ([GAPS, "-p", "height_m=-3"], "parameter 'height_m' must be 0.1 or more, not -3"),
        ([GAPS, "-p", "height_m=high"], "parameter 'height_m' must be like 3.0, not 'high'"),
        ([GAPS, "-p", "hieght_m=3"], "has no parameter hieght_m; known: deceleration_m_s2, "),
    ],
)
def test_a_command_that_cannot_run_does_not_wait(words, message, monkeypatch):
    def wait(*_):
        raise AssertionError("it waits for a graph")

    monkeypatch.setattr(node, "await_link", wait)
    result = CliRunner().invoke(app, ["node", *words])
    assert result.exit_code == 2, result.output
    assert message in result.output


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        ("parameters = { height_m = 0.0 }", "parameter 'height_m' must be 0.1 or more, not 0.0"),
        ("parameters = { wings = 2 }", "has no parameter wings"),
    ],
)
def test_profiles_are_looked_through_before_it_waits(lines, message, monkeypatch, tmp_path):
    def wait(*_):
        raise AssertionError("it waits for a graph")

    for module in (node, launch):
        monkeypatch.setattr(module, "await_link", wait)
    profile, several = tmp_path / "one.toml", tmp_path / "several.toml"
    profile.write_text(lines)
    several.write_text(f'[[launch]]\nnode = "{GAPS}"\n{lines}\n')
    for words in (["node", GAPS, "--profile", str(profile)], ["launch", str(several)]):
        result = CliRunner().invoke(app, words)
        assert result.exit_code == 2, result.output
        assert message in result.output
