"""Checkpoints are whole or refused in one line."""

import pickle

import numpy as np
import pytest
import torch

from volery.core.errors import VoleryError
from volery.learning.training.checkpoint import (
    Checkpoint,
    random_states,
    read_checkpoint,
    restore_random_states,
    write_checkpoint,
)
from volery.learning.training.records import Latest


@pytest.fixture
def kept(tmp_path):
    """Return the file of a checkpoint."""
    state = {
        "array": np.arange(5.0),
        "tensor": torch.arange(3),
        "latest": Latest.of(2, ["alive"]),
        "random": random_states(),
    }
    path = tmp_path / "checkpoint"
    write_checkpoint(path, Checkpoint("homing", "dqn", {"steps": 5}, state))
    return path


def refused(path):
    """Return the error of a file."""
    with pytest.raises(VoleryError) as caught:
        read_checkpoint(path)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_a_checkpoint_reads_as_written(kept):
    found = read_checkpoint(kept)
    assert (found.task, found.algorithm, found.configuration) == ("homing", "dqn", {"steps": 5})
    np.testing.assert_array_equal(found.state["array"], np.arange(5.0))
    assert torch.equal(found.state["tensor"], torch.arange(3))
    assert found.state["latest"].window == 200
    assert [path.name for path in kept.parent.iterdir()] == ["checkpoint"]


def test_random_states_continue(kept):
    state = random_states()
    first = torch.rand(3), np.random.rand(3)  # noqa: NPY002
    restore_random_states(state)
    assert torch.equal(first[0], torch.rand(3))
    np.testing.assert_array_equal(first[1], np.random.rand(3))  # noqa: NPY002


def test_a_file_that_is_cut_off_is_refused_everywhere(kept):
    content = kept.read_bytes()
    for length in [0, 5, 19, 20, 40, 200, 400, len(content) - 1]:
        kept.write_bytes(content[:length])
        assert str(kept) in refused(kept)
    kept.write_bytes(content[:-1])
    assert "the checkpoint is cut off" in refused(kept)


def test_a_damaged_file_is_refused(kept):
    content = bytearray(kept.read_bytes())
    content[-20] ^= 1
    kept.write_bytes(content)
    assert "the checkpoint is damaged" in refused(kept)


def test_a_file_of_another_kind_or_version_is_refused(kept):
    content = kept.read_bytes()
    kept.write_bytes(content.replace(b"checkpoint 1", b"checkpoint 2", 1))
    assert "of another version" in refused(kept)
    kept.write_bytes(b"\x93NUMPY")
    assert "not a checkpoint" in refused(kept)
    kept.unlink()
    assert "no checkpoint to resume from" in refused(kept)


class _Command:
    def __reduce__(self):
        return print, ("executed",)


def test_a_file_cannot_run_code(tmp_path, capsys):
    path = tmp_path / "checkpoint"
    write_checkpoint(path, Checkpoint("homing", "dqn", {}, {"a": _Command()}))
    assert pickle.loads(pickle.dumps(_Command())) is None
    assert capsys.readouterr().out == "executed\n"
    assert "builtins.print" in refused(path)
    assert capsys.readouterr().out == ""


def test_a_checkpoint_that_cannot_be_written_is_one_line(tmp_path):
    with pytest.raises(VoleryError, match="cannot write the checkpoint"):
        write_checkpoint(tmp_path / "none" / "checkpoint", Checkpoint("a", "b", {}, {}))
