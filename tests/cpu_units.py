"""CPU time in units of this machine, so that a claim about speed holds on slow and busy ones."""

import time


def cpu_units(work):
    """CPU time of `work()` over that of a loop of a million multiplications, about 50 ms."""
    unit_s = _cpu_s(_loop)
    work_s = _cpu_s(work)
    return work_s / min(unit_s, _cpu_s(_loop))


def _loop():
    total = 0
    for k in range(1_000_000):
        total += k * k


def _cpu_s(work):
    start_s = time.process_time()
    work()
    return time.process_time() - start_s
