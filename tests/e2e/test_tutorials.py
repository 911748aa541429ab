"""The tutorials run as they stand."""

import sys
from pathlib import Path

import pytest
from own_port import own_port

ROOT = Path(__file__).parents[2]
PAGES = sorted(page for page in (ROOT / "docs" / "tutorials").glob("*.md") if page.stem != "index")


@pytest.fixture(scope="module")
def tutorial():
    sys.path.insert(0, str(ROOT / "tools" / "site"))
    import tutorial

    yield tutorial
    sys.path.remove(str(ROOT / "tools" / "site"))
    del sys.modules["tutorial"]


@pytest.mark.slow
@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_tutorial(tutorial, page, tmp_path):
    port = own_port()
    ports = {
        "--bridge rosbridge": f"--bridge rosbridge={port}",
        "volery node": f"volery node --via rosbridge://127.0.0.1:{port}",
    }
    assert tutorial.run(page, tmp_path, ports).strip()
    image = ROOT / "docs" / "pictures" / f"{page.stem}.png"
    assert (tmp_path / image.name).is_file(), "the image of the page is made by its code"
    assert image.is_file(), "run tools/site/tutorial_pictures.py"


def test_a_failure_in_a_tutorial_is_reported(tutorial, tmp_path):
    page = tmp_path / "broken.md"
    page.write_text("```python\nassert 1 == 2, 'does not hold'\n```\n")
    with pytest.raises(RuntimeError, match="does not hold"):
        tutorial.run(page, tmp_path)


def test_there_are_tutorials():
    assert len(PAGES) >= 4
