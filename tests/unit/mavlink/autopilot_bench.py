"""What the tests of bridges for real autopilots begin with."""

import time

from volery.scenario.load import parse_scenario


def irises(count=1):
    """Scenario of `count` irises side by side on flat ground."""
    uavs = {"type": "iris", "count": count}
    data = {
        "name": "flat",
        "duration_s": 1000.0,
        "types": {"iris": {"airframe": "iris"}},
        "uavs": [{**uavs, "position_m": [0.0, 0.0], "last_position_m": [5.0, 0.0]}],
    }
    return parse_scenario(data, where="flat")


class SilenceClock:
    """Replaces the lock step's `time`: passes only while `autopilot` is silent for good.

    So a stand-in whose response a busy machine delays does not count as silent.
    """

    def __init__(self, monkeypatch):
        self.autopilot = None
        self.now_s = 0.0
        self._last_s = time.monotonic()
        for user in ("engine.lock_step", "mavlink.hil.lock_step"):
            monkeypatch.setattr(f"volery.{user}.time", self)

    def monotonic(self):
        real_s = time.monotonic()
        if self.autopilot is not None and self.autopilot.done.is_set():
            self.now_s += real_s - self._last_s
        self._last_s = real_s
        return self.now_s
