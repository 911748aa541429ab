"""The fleet bench's search for the largest fleet that holds real time."""

import pytest

from volery_benchmarks.fleet import largest


@pytest.mark.parametrize("limit", [1, 4, 5, 7, 60, 61, 95, 400])
@pytest.mark.parametrize("first", [1, 8, 60, 300])
@pytest.mark.parametrize("step", [1, 5])
def test_it_ends_between_what_holds_and_what_does_not(limit, first, step):
    asked = []

    def factor_of(uavs):
        asked.append(uavs)
        return (limit + 0.5) / uavs

    found, factor = largest(factor_of, first=first, step=step)
    assert found == limit // step * step
    assert factor == ((limit + 0.5) / found if found else 0.0)
    assert len(asked) == len(set(asked)) <= 6
    assert all(uavs % step == 0 and uavs > 0 for uavs in asked)


def test_it_ends_even_where_measurements_waver():
    factors = iter([1.3, 0.8, 1.2, 0.99, 1.01, 0.97, 1.0, 0.9, 1.1, 0.9, 1.2, 0.8])
    found, factor = largest(lambda _uavs: next(factors), first=50, step=1)
    assert found >= 50
    assert factor >= 1.0
