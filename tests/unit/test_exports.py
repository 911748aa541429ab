"""What `import volery` offers, and what it costs."""

import subprocess
import sys
from importlib import import_module

import pytest

import volery

PACKAGES = ("volery", "volery.scenario")


def modules_after(statement):
    """The modules that Python has loaded after a statement, beside those of its start."""
    program = (
        f"import sys; before = set(sys.modules); {statement}; print(*set(sys.modules) - before)"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, check=True)
    return set(done.stdout.decode().split())


def test_the_import_loads_next_to_nothing():
    frozen = {"importlib._bootstrap", "importlib._bootstrap_external"}
    assert modules_after("import volery") - frozen <= {
        "volery",
        "importlib",
        "warnings",
        "__future__",
    }


def test_a_scenario_does_without_numba():
    loaded = modules_after("import volery; volery.load_scenario('hover')")
    assert "pydantic" in loaded
    assert not {"numba", "volery.graph", "volery.runtime"} & loaded


@pytest.mark.parametrize("package", PACKAGES)
def test_all_names_exist_and_are_listed(package):
    module = import_module(package)
    assert set(module.__all__) <= set(dir(module))
    for name in module.__all__:
        assert getattr(module, name).__name__ == name
    with pytest.raises(AttributeError, match="has no attribute 'nothing'"):
        _ = module.nothing


def test_errors_are_complete():
    """Each error that users can catch is exported."""
    errors = import_module("volery.core.errors")
    defined = {
        name
        for name, value in vars(errors).items()
        if isinstance(value, type) and issubclass(value, volery.VoleryError)
    }
    assert defined <= set(volery.__all__)


def test_the_version_is_that_of_the_package():
    assert volery.__version__.count(".") == 2
    assert "__version__" in dir(volery)
