import pytest
from page_bench import hover


@pytest.fixture(scope="session")
def flight():
    """Two UAVs that hover, as long as the tests of this folder take."""
    flight = hover()
    yield flight
    flight.close()
