"""Millions of frames into every parser, outside of the test run.

    python tests/fuzz/long_run.py --seconds 60
    python tests/fuzz/long_run.py --seconds 600 --seed 7 cdr ros1
    python tests/fuzz/long_run.py --checks 1000 files   # each kind of file that is loaded or flown

Prints, for each parser, frames, frames a second, the slowest check and how far memory grew after
the first tenth, and what became of files that were loaded and flown. Ends with 1 and the number of
the failing check; `--seed S --only N` repeats it.
"""

from __future__ import annotations

import argparse
import ctypes
import faulthandler
import gc
import random
import resource
import signal
import sys
import time
import traceback
from pathlib import Path

sys.path[:0] = [str(Path(__file__).parent), str(Path(__file__).parents[1])]
from flight_check import OUTCOMES  # noqa: E402
from mutation import Mutator  # noqa: E402
from targets import BUILT, LOADED, TARGETS  # noqa: E402

_HUNG_S = 120.0
"""CPU time of a hundred checks (others may have the processor); of one check that flies:"""
_FLIGHT_HUNG_S = 20.0
_SLOW_S = 2.0
_MAX_GROWTH_MB = 40.0
_FILES = "files"
"""Word for all kinds of files that are loaded or flown."""
_MAX_MEMORY_BYTES = 3 << 30


def random_of(seed, name, number):
    """The draws of one check."""
    return random.Random(f"{seed} {name} {number}")


def run(name, seconds, checks, seed):
    """Feed one parser for a while, or so often; one line about it, and whether all was well."""
    OUTCOMES.clear()
    flies = name in BUILT
    check, slowest_s, frames, number = TARGETS[name], 0.0, 0, 0
    begin = time.monotonic()
    settled = None
    while _goes_on(now := time.monotonic(), begin, seconds, number, checks):
        if settled is None and (number > 0.1 * checks if checks else now > begin + 0.1 * seconds):
            settled = _resident_mb()
        if flies or number % 100 == 0:
            signal.setitimer(signal.ITIMER_PROF, _FLIGHT_HUNG_S if flies else _HUNG_S)
        began_s = time.process_time()  # others may have the processor meanwhile
        try:
            frames += check(Mutator(random_of(seed, name, number)))
        except Exception:
            traceback.print_exc()
            return f"{name}: check {number} of seed {seed} FAILED", False
        slowest_s = max(slowest_s, time.process_time() - began_s)
        number += 1
    signal.setitimer(signal.ITIMER_PROF, 0.0)
    grown, taken_s = _resident_mb() - (settled or 0.0), time.monotonic() - begin
    well = slowest_s < (_FLIGHT_HUNG_S if flies else _SLOW_S) and grown < _MAX_GROWTH_MB
    return (
        f"{name}: {frames} frames, {frames / taken_s:.0f}/s, slowest {1000 * slowest_s:.0f} ms, "
        f"memory {grown:+.1f} MB{_outcome_summary()}{'' if well else ' FAILED'}",
        well,
    )


def _goes_on(now, begin, seconds, number, checks):
    return number < checks if checks else now < begin + seconds


def _outcome_summary():
    counts = ", ".join(f"{count} {what}" for what, count in sorted(OUTCOMES.items()))
    return f" ({counts})" if counts else ""


def _resident_mb():
    gc.collect()
    ctypes.CDLL(None).malloc_trim(0)
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return pages * resource.getpagesize() / 1e6


def _named(name):
    return (*BUILT, *LOADED) if name == _FILES else (name,)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("targets", nargs="*", default=list(TARGETS), metavar="PARSER")
    parser.add_argument("--seconds", type=float, default=60.0, help="for each parser")
    parser.add_argument("--checks", type=int, default=0, help="so many of each, however long")
    parser.add_argument("--seed", default="0")
    parser.add_argument("--only", type=int, help="this check alone")
    options = parser.parse_args()
    resource.setrlimit(resource.RLIMIT_AS, (_MAX_MEMORY_BYTES, _MAX_MEMORY_BYTES))
    faulthandler.register(signal.SIGPROF, chain=True)  # where it hangs; then the process ends
    well = True
    names = [each for name in options.targets for each in _named(name)]
    for name in names:
        if options.only is not None:
            TARGETS[name](Mutator(random_of(options.seed, name, options.only)))
            continue
        line, good = run(name, options.seconds, options.checks, options.seed)
        sys.stdout.write(f"{line}\n")
        sys.stdout.flush()
        well = well and good
    return 0 if well else 1


if __name__ == "__main__":
    sys.exit(main())
