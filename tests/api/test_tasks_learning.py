"""Training a policy takes few lines, a script that runs as it is."""

import runpy

import pytest
from test_tasks_scenarios import FOLDER, lines_of

pytest.importorskip("stable_baselines3")
SCRIPT = FOLDER / "train_a_policy.py"


def test_training_takes_few_lines():
    assert 3 < lines_of(SCRIPT.read_text(encoding="utf-8")) <= 6


@pytest.mark.slow
def test_the_trained_policy_flies_to_targets(capsys):
    done = runpy.run_path(str(SCRIPT), run_name="__main__")
    assert done["result"].success > 0.5
    assert done["action"] in range(7)
    assert "of 50 episodes succeed" in capsys.readouterr().out
