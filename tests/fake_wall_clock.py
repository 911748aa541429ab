"""Wall time that only waiting moves: what paces a run is tested without a machine's load in it."""

import time
from types import SimpleNamespace


class FakeWallClock:
    """Seconds that pass while something waits, and no others."""

    def __init__(self):
        self.now_s = 100.0
        self.time = SimpleNamespace(perf_counter=lambda: self.now_s, thread_time=time.thread_time)
        """Replaces the module `time`."""

    def wait(self, timeout_s):
        """Replaces a condition's or an event's `wait`: nothing ends it early."""
        self.now_s += timeout_s
