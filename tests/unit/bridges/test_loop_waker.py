"""Wakes callbacks of a loop from other threads."""

import asyncio
import gc
import threading
import weakref

import pytest

from volery.bridges.loop_waker import LoopWaker, wake_of


class CountingLoop:
    """Counts the calls that wake a loop."""

    def __init__(self, loop):
        self.calls = 0
        self._loop = loop
        self.call_exception_handler = loop.call_exception_handler
        self.call_soon = loop.call_soon

    def call_soon_threadsafe(self, callback):
        self.calls += 1
        self._loop.call_soon_threadsafe(callback)


def in_thread(work):
    thread = threading.Thread(target=work)
    thread.start()
    thread.join()


def test_one_system_call_wakes_a_busy_loop_for_all_callbacks():
    async def run():
        counting = CountingLoop(asyncio.get_running_loop())
        waker, ran = LoopWaker(counting), []

        def wake_all():
            for number in range(1000):
                waker.run(lambda number=number: ran.append(number))

        in_thread(wake_all)  # the loop is busy meanwhile
        await asyncio.sleep(0)
        await asyncio.sleep(0)
        assert ran == list(range(1000))
        assert counting.calls == 1
        in_thread(lambda: waker.run(lambda: ran.append("later")))
        await asyncio.sleep(0.01)
        assert (ran[-1], counting.calls) == ("later", 2)

    asyncio.run(run())


def test_a_busy_loop_is_not_woken_again_while_it_finds_callbacks():
    async def run():
        counting = CountingLoop(asyncio.get_running_loop())
        waker, ran = LoopWaker(counting), []
        for number in range(100):  # one in each round
            in_thread(lambda number=number: waker.run(lambda: ran.append(number)))
            await asyncio.sleep(0)
        assert counting.calls == 1
        await asyncio.sleep(0)
        assert ran == list(range(100))

    asyncio.run(run())


def test_no_callback_is_lost_between_threads():
    async def run():
        loop, ran = asyncio.get_running_loop(), []
        wakes = [wake_of(loop, lambda k=k: ran.append(k)) for k in range(4)]

        def wake_often(wake):
            for _ in range(5000):
                wake()

        threads = [threading.Thread(target=wake_often, args=(wake,)) for wake in wakes]
        for thread in threads:
            thread.start()
        while any(thread.is_alive() for thread in threads):
            await asyncio.sleep(0)
        await asyncio.sleep(0.01)
        assert [ran.count(k) for k in range(4)] == [5000] * 4

    asyncio.run(run())


def test_a_callback_that_fails_is_reported_and_stops_no_other():
    async def run():
        loop, ran, reported = asyncio.get_running_loop(), [], []
        loop.set_exception_handler(lambda _loop, context: reported.append(context["exception"]))
        wake_of(loop, lambda: 1 / 0)()
        wake_of(loop, lambda: ran.append(1))()
        await asyncio.sleep(0.01)
        assert ran == [1]
        assert isinstance(reported[0], ZeroDivisionError)

    asyncio.run(run())


def test_a_loop_that_has_ended_is_not_woken_and_not_kept():
    loop = asyncio.new_event_loop()
    wake = wake_of(loop, lambda: pytest.fail("it runs in no loop"))
    loop.close()
    wake()
    gone = weakref.ref(loop)
    del loop, wake
    gc.collect()
    assert gone() is None
