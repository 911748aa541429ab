import pytest
from page_bench import hover


@pytest.fixture(scope="module")
def flight():
    """Two UAVs that hover, as long as the tests of a file take."""
    flight = hover()
    yield flight
    flight.close()
