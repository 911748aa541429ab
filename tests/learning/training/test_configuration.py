"""Configurations are data that is checked; tasks are found by name."""

import pytest

from volery.core.errors import ScenarioError, VoleryError
from volery.learning.tasks import load_task
from volery.learning.training.algorithms import _schedule
from volery.learning.training.configuration import TrainingConfiguration, load_configuration
from volery.learning.training.task_loading import find_task


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig"])
def test_a_file_sets_options(tmp_path, encoding):
    path = tmp_path / "training.toml"
    path.write_text('algorithm = "sac"\nhidden = [32]\n[sac]\ntau = 0.5\n', encoding=encoding)
    found = load_configuration("homing", path)
    assert (found.algorithm, found.hidden, found.sac.tau) == ("sac", (32,), 0.5)
    assert found.sac.batch == TrainingConfiguration().sac.batch


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("algorithm = 'a2c'", "key 'algorithm': 'ppo', 'dqn' or 'sac' is needed (found 'a2c')"),
        ("[ppo]\nepochs = 0", "key 'ppo.epochs': a number of at least 1 is needed"),
        ("steps_per_s = 5", "unknown key 'steps_per_s'; did you mean 'steps'? Allowed here: "),
        ("steps = ", "not TOML"),
        ("gamma = nan", "gamma"),
    ],
)
def test_a_wrong_file_is_one_line(tmp_path, text, reason):
    path = tmp_path / "training.toml"
    path.write_text(text)
    with pytest.raises(VoleryError, match=r"training\.toml") as caught:
        load_configuration("homing", path)
    assert reason in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_missing_file_is_one_line(tmp_path):
    with pytest.raises(VoleryError, match="No such file"):
        load_configuration("homing", tmp_path / "none.toml")


def test_options_that_are_none_keep_the_configuration():
    base = TrainingConfiguration(steps=7)
    assert base.changed(steps=None, seed=3) == TrainingConfiguration(steps=7, seed=3)
    with pytest.raises(VoleryError, match="num_envs"):
        base.changed(num_envs=0)


def test_the_learning_rate_falls_linearly():
    assert _schedule(TrainingConfiguration(learning_rate=0.5)) == 0.5
    rate = _schedule(TrainingConfiguration(learning_rate=0.5, final_learning_rate=0.1))
    assert [rate(1.0), rate(0.5), rate(0.0)] == pytest.approx([0.5, 0.3, 0.1])


def test_tasks_are_found_by_name_module_and_file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    source = (
        "from volery.learning.tasks import load_task\ndef mine():\n    return load_task('homing')\n"
    )
    (tmp_path / "own.py").write_text(source)
    task = load_task("homing")
    for name in ("homing", "volery.learning.tasks.homing:homing", "own.py:mine"):
        assert find_task(name).name == task.name
    assert find_task(task) is task


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("homming", "unknown task 'homming'"),
        ("none.py:task", "no such file"),
        ("no_such_module:task", "cannot import 'no_such_module'"),
        ("volery.learning.tasks.homing:none", "no function 'none'"),
        ("builtins:dict", "returns dict, not a Task"),
        ("broken.py:task", "broken.py: ZeroDivisionError"),
    ],
)
def test_a_wrong_task_is_one_line(tmp_path, monkeypatch, name, reason):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "broken.py").write_text("1 / 0\n")
    with pytest.raises(ScenarioError) as caught:
        find_task(name)
    assert reason in str(caught.value)
    assert "\n" not in str(caught.value)
