"""The search for failing flights: samplers, ratings, simplified failures; flights are made up."""

from __future__ import annotations

import numpy as np
import pytest
from studies import TINY

from volery.cluster.batches import BatchResult
from volery.cluster.errors import StudyError
from volery.cluster.executor import BatchLoss
from volery.cluster.failure_search import FailureSearch, RandomSampler, TpeSampler
from volery.cluster.loading import load_study
from volery.cluster.runs import RunResult, code_version
from volery.cluster.variations import Variation
from volery.verdicts.verdict import Finding, Verdict

WIND = Variation("wind", 0.0, 8.0)
HEIGHT = Variation("types.f450.flight.take_off_altitude_m", 1.0, 5.0)


class MadeFlights:
    """An executor whose flights have margins that a function of the values gives."""

    def __init__(self, margin, num_workers=1):
        self.num_workers, self._margin = num_workers, margin
        self._waiting, self.flown, self.recorded = [], [], []

    def can_submit(self):
        return len(self._waiting) < self.num_workers

    def submit(self, batch):
        assert self.can_submit()
        self._waiting.append(batch)

    def collect(self, _timeout_s):
        batch = self._waiting.pop()  # the last one first: workers end in any order
        (run,) = batch.runs
        (self.recorded if batch.record else self.flown).append(run)
        values = {name: number(value) for name, value in run.values.items()}
        margin = self._margin(values, run.seed)
        if margin is None:
            return [BatchLoss(batch, "was killed")]
        verdict = Verdict.of("calm", "speed", Finding("", margin, "m/s", 3.0, "uav1"))
        return [BatchResult(batch.number, (result_of(run, verdict),))]


def number(value):
    return value[0] if isinstance(value, list) else value


def wind_of(values):
    return number(values.get("vary_0_wind", 0.0))


def result_of(run, verdict):
    return RunResult(
        run.id, "done", dict(run.values), run.seed, code_version(), verdicts=[verdict.to_data()]
    )


def search_of(margin, variations=(WIND, HEIGHT), seeds=(1, 1), **options):
    parameters = {
        v.name(k): {"key": v.key, "values": [v.value(v.low)]} for k, v in enumerate(variations)
    }
    loaded = load_study({**TINY, "parameters": parameters, "combine": "list"})
    executor = MadeFlights(margin, **options)
    return FailureSearch(loaded, variations, seeds, executor), executor


def weakness(values, _seed):
    """Fails in a hundredth of the space: strong wind, at one height; the margin leads there."""
    wind, height = values.get("vary_0_wind", 0.0), values.get(HEIGHT.name(1), 2.5)
    return 0.3 + 0.4 * abs(height - 4.0) - 0.1 * max(0.0, wind - 4.5)


def test_a_margin_that_leads_there_is_followed():
    counts = {}
    for kind in (TpeSampler, RandomSampler):
        found = []
        for seed in range(8):
            search, _ = search_of(weakness)
            failure = search.search(kind(search.dimensions, seed), 400)
            found.append(400 if failure.result.is_passed else failure.flights)
        counts[kind] = float(np.median(found))
    assert counts[TpeSampler] <= 100
    assert counts[RandomSampler] > 1.5 * counts[TpeSampler]


def test_the_search_does_not_settle_where_margins_are_low():
    """A quarter of the square is far from the best corner; one proposal in four is random."""
    pytest.importorskip("optuna")
    for seed in range(4):
        sampler, num_far = TpeSampler(2, seed), 0
        for proposal in range(160):
            (point,) = sampler.propose(1)
            sampler.learn([sum(point)])
            num_far += proposal >= 40 and min(point) > 0.5
        assert num_far >= 7  # without the random ones 4 or 5


def test_no_failure_takes_all_flights():
    search, executor = search_of(lambda values, _seed: 20.0 - wind_of(values), num_workers=2)
    nearest = search.search(RandomSampler(search.dimensions, 1), 7)
    assert len(executor.flown) == 7
    assert nearest.result.is_passed
    assert wind_of(nearest.run.values) == max(wind_of(run.values) for run in executor.flown)


def test_the_search_does_not_depend_on_the_order_of_workers():
    def points(executor):
        return sorted((run.seed, *map(number, run.values.values())) for run in executor.flown)

    runs = []
    for _ in range(2):
        search, executor = search_of(weakness, seeds=(1, 50), num_workers=3)
        search.search(TpeSampler(search.dimensions, 4), 30)
        runs.append(points(executor))
    assert runs[0] == runs[1]
    assert len({seed for seed, *_ in runs[0]}) > 5


def test_a_failure_is_simplified():
    search, _ = search_of(lambda values, _seed: 3.03 - wind_of(values))
    failure = search.search(RandomSampler(search.dimensions, 1), 100)
    assert len(failure.run.values) == 2
    simple = search.simplified(failure)
    assert list(simple.run.values) == ["vary_0_wind"]  # the height does not matter
    assert 3.03 <= wind_of(simple.run.values) < 3.03 + 8.0 / 2**5
    assert wind_of(simple.run.values) == round(wind_of(simple.run.values), 2)
    assert not simple.result.is_passed
    assert simple.run.seed == failure.run.seed


def test_a_failure_at_the_low_end_has_the_value_of_the_low_end():
    search, _ = search_of(lambda values, _seed: -1.0 if HEIGHT.name(1) in values else 1.0)
    failure = search.search(RandomSampler(search.dimensions, 1), 100)
    simple = search.simplified(failure)
    assert dict(simple.run.values) == {HEIGHT.name(1): HEIGHT.low}


def test_a_found_failure_is_recorded():
    search, executor = search_of(lambda values, _seed: 3.0 - wind_of(values))
    failure = search.search(RandomSampler(search.dimensions, 1), 100)
    assert not executor.recorded
    search.recorded(failure)
    assert executor.recorded == [failure.run]


def test_a_failure_of_a_seed_alone_needs_no_values():
    search, _ = search_of(lambda _values, seed: -1.0 if seed == 7 else 1.0, seeds=(1, 9))
    failure = search.simplified(search.search(RandomSampler(search.dimensions, 2), 500))
    assert (dict(failure.run.values), failure.run.seed) == ({}, 7)


def test_a_worker_that_ends_is_a_failure():
    search, _ = search_of(lambda values, _seed: None if values["vary_0_wind"] > 4.0 else 1.0)
    failure = search.search(RandomSampler(search.dimensions, 1), 100)
    assert failure.result.error == "its worker was killed"


@pytest.mark.parametrize("text", ["wind", "wind=3", "wind=a:b", "wind=3:3", "=1:2"])
def test_ranges_that_are_none(text):
    with pytest.raises(StudyError, match="--vary"):
        Variation.of(text)


def test_ranges():
    assert Variation.of("wind = 0 : 6") == Variation("wind", 0.0, 6.0)
    assert WIND.value(3.0) == [3.0, 0.0, 0.0]
    assert WIND.number([3.0, 0.0, 0.0]) == HEIGHT.number(3.0) == 3.0
    assert HEIGHT.at(0.25) == 2.0
    drawn = [WIND.drawn(seed, 0) for seed in range(100)]
    assert 0.0 <= min(drawn) < 1.0
    assert 7.0 < max(drawn) <= 8.0


@pytest.mark.parametrize(
    ("text", "number", "rounded"),
    [
        ("a=0:14", 7.1234567, [7.0, 7.1]),
        ("a=1:6", 1.0072139, [1.0, 1.01]),
        ("a=100:101", 100.0372139, [100.0, 100.04]),
        ("a=0:2000", 1234.5678, [1200.0, 1230.0]),
        ("a=1.04:1.2", 1.0412345, [1.04, 1.041]),
    ],
)
def test_rounded_values(text, number, rounded):
    found = Variation.of(text).rounded(number)
    assert found[:2] == pytest.approx(rounded, abs=1e-9)
