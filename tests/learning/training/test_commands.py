"""`volery train`, `evaluate` and `export-policy`."""

import io
import json
import os
import signal

import pytest
from PIL import Image
from typer.testing import CliRunner

from volery.cli.app import app
from volery.learning.training.progress import TrainingProgress

TRAINING = """
algorithm = "dqn"
num_envs = 4
steps = 64
hidden = [8]
threads = 1
evaluation_episodes = 2
target_success = 2.0
[dqn]
batch = 8
buffer_size = 100
learning_starts = 8
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Return a working folder with a configuration."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "tiny.toml").write_text(TRAINING)
    return tmp_path


def run(*words):
    return CliRunner().invoke(app, [str(word) for word in words])


def train(*words):
    return run("train", "homing", "--config", "tiny.toml", "--no-tensorboard", *words)


def test_a_training_writes_its_folder_and_its_policy_flies(folder):
    result = train()
    assert result.exit_code == 0, result.output
    assert "training/homing/policy.npz: success" in result.output
    assert "continue: volery train homing --resume --out training/homing --steps N" in result.output
    out = folder / "training" / "homing"
    assert {path.name for path in out.iterdir()} == {"policy.npz", "record.json", "checkpoint"}
    record = json.loads((out / "record.json").read_text())
    assert (record["algorithm"], record["trained_steps"], record["ending"]) == ("dqn", 64, "steps")
    assert record["curve"][-1]["steps"] == 64

    shown = run("evaluate", out / "policy.npz", "--episodes", 3, "--threads", 1, "--json")
    found = json.loads(shown.output)
    assert found["episodes"] == 3
    assert found["success_low"] <= found["success"] <= found["success_high"]
    table = run("evaluate", out / "policy.npz", "--episodes", 3, "--threads", 1).output
    for word in ("success", "return", "length", "reward approach", "ends: time_limit"):
        assert word in table

    exported = run("export-policy", out / "policy.npz", folder / "own.onnx")
    assert "observation (N, 6) to action (N)" in exported.output
    assert (folder / "own.onnx").stat().st_size > 100


def test_trainings_get_folders_of_their_own_and_resume(folder):
    assert train().exit_code == train("--seed", 5).exit_code == 0
    assert sorted(path.name for path in (folder / "training").iterdir()) == ["homing", "homing-2"]
    refused = train("--out", "training/homing")
    assert refused.exit_code == 2
    assert "training/homing holds a training: continue it by --resume" in refused.output
    resumed = run("train", "homing", "--resume", "--steps", 96, "--no-tensorboard")
    assert "training/homing-2/policy.npz" in resumed.output
    record = json.loads((folder / "training" / "homing-2" / "record.json").read_text())
    assert (record["trained_steps"], record["seed"]) == (96, 5)
    other = run("train", "hover", "--resume", "--out", "training/homing", "--no-tensorboard")
    assert other.exit_code == 2
    assert "the checkpoint is of task 'homing', not 'hover'" in other.output


def test_ctrl_c_keeps_the_best_policy_and_says_how_to_resume(folder, monkeypatch):
    def interrupt(self, trainer):
        if trainer.steps == 32:
            os.kill(os.getpid(), signal.SIGINT)

    monkeypatch.setattr(TrainingProgress, "on_update", interrupt)
    result = train()
    assert result.exit_code == 0, result.output
    assert "stopped with Ctrl-C; continue: volery train homing --resume" in result.output
    assert json.loads((folder / "training/homing/record.json").read_text())["trained_steps"] == 32


def test_event_files_hold_scalars(folder, monkeypatch):
    events = pytest.importorskip("tensorboard.backend.event_processing.event_accumulator")
    monkeypatch.setattr("volery.learning.training.tensorboard_log._SCALAR_PERIOD_S", 0.0)
    monkeypatch.setattr("volery.learning.training.tensorboard_log._HISTOGRAM_PERIOD_S", 0.0)
    monkeypatch.setattr("volery.learning.training.tensorboard_log._VIDEO_PERIOD_S", 0.0)
    result = run("train", "homing", "--config", "tiny.toml")
    assert result.exit_code == 0, result.output
    found = events.EventAccumulator(str(folder / "training" / "homing" / "tensorboard"))
    tags = found.Reload().Tags()
    (video,) = found.Images("evaluation/episode")
    assert (video.width, video.height) == (160, 120)
    film = Image.open(io.BytesIO(video.encoded_image_string))
    assert film.format == "GIF"
    assert film.n_frames > 1
    assert {"time/steps_per_s", "evaluation/success", "train/loss"} <= set(tags["scalars"])
    assert {"weights/policy.0.weight", "actions/0"} <= set(tags["histograms"])


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (["train", "homming"], "unknown task 'homming'"),
        (
            ["train", "homing", "--algorithm", "a2c"],
            "key 'algorithm': 'ppo', 'dqn' or 'sac' is needed",
        ),
        (["train", "homing", "--resume"], "no training of 'homing' in training/"),
        (
            ["train", "hover", "--algorithm", "dqn", "--no-tensorboard"],
            "dqn needs discrete actions",
        ),
        (["evaluate", "none.npz"], "no policy file 'none.npz'"),
        (["export-policy", "none", "a.onnx"], "no policy 'none'"),
    ],
)
def test_wrong_words_are_one_line(folder, words, reason):
    result = run(*words)
    assert result.exit_code == 2
    assert reason in result.output
    assert len(result.output.strip().splitlines()) == 1
