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
        self._waiting, self.flown = [], []

    def can_submit(self):
        return len(self._waiting) < self.num_workers

    def submit(self, batch):
        assert self.can_submit()
        self._waiting.append(batch)

    def collect(self, _timeout_s):
        batch = self._waiting.pop()  # the last one first: workers end in any order
        (run,) = batch.runs
        self.flown.append(run)
        values = {name: number(value) for name, value in run.values.items()}
        margin = self._margin(values, run.seed)
        if margin is None:
            return [BatchLoss(batch, "was killed")]
        verdict = Verdict.of("calm", "speed", Finding("", margin, "m/s", 3.0, "uav1"))
        return [BatchResult(batch.number, (result_of(run, verdict),))]


def number(value):
    return value[0] if isinstance(value, list) else value


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
            found.append(400 if failure is None else failure.flights)
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
    search, executor = search_of(lambda _values, _seed: 1.0, num_workers=2)
    assert search.search(RandomSampler(search.dimensions, 1), 7) is None
    assert len(executor.flown) == 7


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
    def needs_wind(values, _seed):
        return 3.0 - values.get("vary_0_wind", 0.0)

    search, _ = search_of(needs_wind)
    failure = search.search(RandomSampler(search.dimensions, 1), 100)
    assert len(failure.values) == 2
    simple = search.simplified(failure)
    assert list(simple.values) == ["vary_0_wind"]  # the height does not matter
    assert 3.0 <= number(simple.values["vary_0_wind"]) < 3.0 + 8.0 / 2**5
    assert not simple.result.is_passed
    assert simple.seed == failure.seed


def test_a_failure_of_a_seed_alone_needs_no_values():
    search, _ = search_of(lambda _values, seed: -1.0 if seed == 7 else 1.0, seeds=(1, 9))
    failure = search.simplified(search.search(RandomSampler(search.dimensions, 2), 500))
    assert (dict(failure.values), failure.seed) == ({}, 7)


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
