"""Tests the limits of external clients' time in the simulation's thread, with fake clocks."""

from __future__ import annotations

import pytest

from volery.core.errors import CommandError
from volery.engine.call_budget import MAX_FRACTION, CallBudget
from volery.engine.command_queue import CommandQueue


class Clock:
    def __init__(self):
        self.now_s = 0.0

    def __call__(self):
        return self.now_s


class Bench:
    """An inbox whose commands cost what they say; `done` holds what was called, in order."""

    def __init__(self):
        self.wall, self.cpu = Clock(), Clock()
        self.inbox = CommandQueue(cpu_s=self.cpu, now_s=self.wall)
        self.done = []

    def post(self, queue, name, cost_s=0.0):
        def act():
            self.cpu.now_s += cost_s
            self.wall.now_s += cost_s
            self.done.append(name)

        return queue.post(act)

    def work(self, seconds, *, tick_s=0.005, idle_s=0.0):
        """Let the engine compute for so long, between ticks do what is posted."""
        left = seconds
        while left > 0.0:
            self.wall.now_s += tick_s
            self.cpu.now_s += tick_s
            left -= tick_s
            if self.inbox.work_off(idle_s):
                self.inbox.end_round()


@pytest.fixture
def bench():
    return Bench()


def test_commands_of_all_are_taken_in_the_order_of_arrival(bench):
    first, second = bench.inbox.open_queue(), bench.inbox.open_queue()
    for number in range(30):
        bench.post((first, second, bench.inbox)[number % 3], number)
    assert bench.inbox.work_off(0.0)
    assert bench.done == list(range(30))
    assert not bench.inbox.has_waiting
    assert not bench.inbox.work_off(0.0)


def test_a_client_that_calls_without_end_costs_a_twentieth_and_loses_nothing(bench):
    client = bench.inbox.open_queue()
    for number in range(5_000):
        bench.post(client, number, 0.001)
    bench.work(10.0)
    spent_s = len(bench.done) * 0.001
    assert spent_s <= MAX_FRACTION * (10.0 + spent_s) + 0.06
    assert spent_s >= MAX_FRACTION * 10.0
    assert bench.done == list(range(len(bench.done)))
    assert bench.inbox.has_waiting


def test_all_clients_together_cost_a_twentieth(bench):
    queues = [bench.inbox.open_queue() for _ in range(50)]
    for number in range(1_000):
        for k, queue in enumerate(queues):
            bench.post(queue, (k, number), 0.0005)
    bench.work(10.0)
    bench.done.clear()  # what they had in advance
    bench.work(10.0)
    assert len(bench.done) * 0.0005 <= MAX_FRACTION * 11.0
    shares = [sum(k == client for client, _ in bench.done) for k in range(50)]
    assert min(shares) >= 0.8 * max(shares)


def test_a_quiet_client_is_not_delayed_by_a_busy_one(bench):
    busy, quiet = bench.inbox.open_queue(), bench.inbox.open_queue()
    for number in range(3_000):
        bench.post(busy, number, 0.001)
    bench.work(3.0)
    bench.post(quiet, "quiet", 0.001)
    bench.work(0.001)
    assert "quiet" in bench.done[-2:]


def test_what_belongs_to_no_client_is_never_deferred(bench):
    busy = bench.inbox.open_queue()
    for number in range(1_000):
        bench.post(busy, number, 0.01)
    bench.work(0.1)
    bench.post(bench.inbox, "own", 5.0)
    bench.work(0.001)
    assert "own" in bench.done[-2:]


def test_idle_time_is_free(bench):
    client = bench.inbox.open_queue()
    for number in range(1_000):
        bench.post(client, number, 0.001)
    bench.inbox.work_off(0.5)
    assert 500 <= len(bench.done) <= 560
    bench.inbox.work_off()
    assert bench.done == list(range(1_000))


def test_what_a_command_causes_afterwards_is_charged_too(bench):
    client = bench.inbox.open_queue()
    for number in range(1_000):
        before = len(bench.done)
        bench.post(client, number)
        bench.wall.now_s += 0.001
        if bench.inbox.work_off(0.0):
            bench.cpu.now_s += 0.01 * (len(bench.done) - before)  # nodes that answer
            bench.inbox.end_round()
    assert len(bench.done) <= 15


def test_after_one_long_call_a_client_waits_seconds_not_minutes(bench):
    client = bench.inbox.open_queue()
    bench.post(client, "long", 60.0)
    bench.work(0.001)
    bench.post(client, "next", 0.001)
    bench.work(2.5)
    assert bench.done == ["long", "next"]


def test_others_get_what_one_client_does_not_need():
    clock = Clock()
    budget = CallBudget(clock)
    budget.spend("small", 0.001)
    budget.spend("large", 0.05)
    clock.now_s = 0.3
    budget.earn()  # 15 ms
    assert not budget.may_spend("large") or budget._owed_s == {"large": pytest.approx(0.036)}
    assert budget._owed_s == {"large": pytest.approx(0.036)}


def test_after_the_end_commands_fail_and_say_why(bench):
    client = bench.inbox.open_queue()
    before = [bench.post(client, "never"), bench.post(bench.inbox, "never")]
    bench.inbox.close("the simulation is closed")
    after = [bench.post(client, "never"), bench.post(bench.inbox, "never")]
    for future in (*before, *after):
        with pytest.raises(CommandError, match="the simulation is closed"):
            future.result(0.0)
    bench.inbox.work_off()
    assert bench.done == []


def test_a_command_that_fails_is_reported_to_its_sender_alone(bench):
    client = bench.inbox.open_queue()
    broken = client.post(lambda: 1 / 0)
    fine = client.post(lambda: 7)
    bench.inbox.work_off(0.0)
    assert isinstance(broken.exception(0.0), ZeroDivisionError)
    assert fine.result(0.0) == 7
