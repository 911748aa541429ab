"""A user without a home folder, as in some containers of clusters, is not refused."""

from pathlib import Path

import pytest

from volery.cli import trust
from volery.core.private_folders import state_root


@pytest.fixture
def homeless(monkeypatch):
    def home():
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.setattr(Path, "home", home)
    monkeypatch.delenv("XDG_STATE_HOME", raising=False)


@pytest.mark.usefixtures("homeless")
def test_state_is_not_saved():
    with pytest.raises(OSError, match="home directory"):
        state_root()


@pytest.mark.usefixtures("homeless")
def test_the_user_is_asked_each_time_and_trusted(tmp_path, monkeypatch):
    asked = []
    monkeypatch.setattr(trust, "at_terminal", lambda: True)
    monkeypatch.setattr(trust.typer, "confirm", lambda *_, **__: asked.append(1) or True)
    for _ in range(2):
        assert trust.may_run_local_code(tmp_path / "mine.toml", ["my_node"])
    assert len(asked) == 2
