from pathlib import Path

import pytest

import volery.world


@pytest.fixture(scope="session")
def forest_data() -> Path:
    return Path(volery.world.__file__).parent / "data" / "forests"
