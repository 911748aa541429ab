"""Writes the digests of all shipped scenarios, and compares two such files.

A change of structure must leave every flight equal to the byte. On one machine, before and after:

    python tools/scenario_digests.py write before.json
    python tools/scenario_digests.py write after.json
    python tools/scenario_digests.py compare before.json after.json

Each scenario flies once for each number of threads, in a process of its own. The content of a topic
(times and CDR bytes) has a digest without its name, so that `compare` recognizes renamed topics.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import multiprocessing
import platform
import sys
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import TypedDict

from volery import Simulation, load_scenario
from volery.graph.messages import Published
from volery.runtime.output_sink import NOT_OF_THE_WORLD
from volery.scenario import library

DEFAULT_SECONDS = 8.0
THREADS = (1, 2)


class Flight(TypedDict):
    """Digests of one flight."""

    digest: str
    by_topic: str
    topics: dict[str, str]


class Digests(TypedDict):
    """What `write` leaves in its file: flights by `SCENARIO, N threads`."""

    machine: str
    seconds: float
    flights: dict[str, Flight]


class TopicDigests:
    """Hashes type, times and CDR bytes of each topic's messages, not its name."""

    def __init__(self) -> None:
        self._hashes: dict[str, hashlib._Hash] = {}

    def add(self, published: Published) -> None:
        """Adds one message."""
        topic = self._hashes.get(published.topic)
        if topic is None:
            topic = hashlib.sha256(published.msgtype.encode())
            self._hashes[published.topic] = topic
        topic.update(str(published.time_ns).encode())
        topic.update(published.cdr)

    def hexdigests(self) -> dict[str, str]:
        """Returns the digest of each topic, by name."""
        return {name: each.hexdigest() for name, each in sorted(self._hashes.items())}


def fly(name: str, threads: int, seconds: float) -> Flight:
    """Flies a shipped scenario and returns its digests."""
    with Simulation(load_scenario(name), threads=threads) as simulation:
        simulation.diagnostics.enable_digest()
        topics = TopicDigests()
        simulation.graph.subscribe_all(topics.add, is_of_the_world)
        simulation.run(seconds)
        return {
            "digest": simulation.diagnostics.digest(),
            "by_topic": simulation.diagnostics.digest(by_topic=True),
            "topics": topics.hexdigests(),
        }


def is_of_the_world(topic: str) -> bool:
    """Returns whether a topic carries simulated data only, no wall time."""
    return not topic.startswith(NOT_OF_THE_WORLD)


def write(path: Path, names: list[str], seconds: float) -> None:
    """Flies the scenarios and writes their digests."""
    flights: dict[str, Flight] = {}
    spawn = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(1, mp_context=spawn, max_tasks_per_child=1) as pool:
        for name in names:
            for threads in THREADS:
                key = f"{name}, {threads} threads"
                flights[key] = pool.submit(fly, name, threads, seconds).result()
                print(f"{flights[key]['digest'][:16]}  {key}", flush=True)
    found: Digests = {"machine": platform.platform(), "seconds": seconds, "flights": flights}
    path.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")


def differences(before: Digests, after: Digests) -> list[str]:
    """Returns a line for each difference; an empty list if all flights are equal."""
    lines = []
    if before["seconds"] != after["seconds"]:
        lines.append(f"flown for {before['seconds']:g} s and {after['seconds']:g} s")
    old, new = before["flights"], after["flights"]
    lines += [f"{key}: only before" for key in sorted(old.keys() - new.keys())]
    lines += [f"{key}: only after" for key in sorted(new.keys() - old.keys())]
    for key in sorted(old.keys() & new.keys()):
        if old[key]["digest"] != new[key]["digest"]:
            topics = topic_differences(old[key]["topics"], new[key]["topics"])
            lines += [f"{key}: {line}" for line in topics or ["states or the order of messages"]]
    return lines


def topic_differences(before: dict[str, str], after: dict[str, str]) -> list[str]:
    """Returns a line for each topic that was renamed, changed, lost or added."""
    lost = {name: before[name] for name in sorted(before.keys() - after.keys())}
    added = {name: after[name] for name in sorted(after.keys() - before.keys())}
    lines = []
    for name, content in lost.items():
        same = next((other for other, its in added.items() if its == content), None)
        if same is not None:
            del added[same]
        lines.append(f"{name} is gone" if same is None else f"{name} is renamed {same}")
    lines += [f"{name} is new" for name in added]
    shared = sorted(before.keys() & after.keys())
    return lines + [f"{name} has changed" for name in shared if before[name] != after[name]]


def compare(before: Path, after: Path) -> int:
    """Prints how two files differ and returns the exit status."""
    old, new = (json.loads(path.read_text(encoding="utf-8")) for path in (before, after))
    lines = differences(old, new)
    print("\n".join(lines) or f"{len(old['flights'])} flights are equal")
    return 1 if lines else 0


def main() -> int:
    """Reads the command line."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    commands = parser.add_subparsers(dest="command", required=True)
    writing = commands.add_parser("write", help="fly and write digests")
    writing.add_argument("file", type=Path)
    writing.add_argument("--seconds", type=float, default=DEFAULT_SECONDS, help="of each flight")
    writing.add_argument("--only", nargs="+", default=library.names(), help="scenarios")
    comparing = commands.add_parser("compare", help="compare two files; exit status 1: they differ")
    comparing.add_argument("before", type=Path)
    comparing.add_argument("after", type=Path)
    args = parser.parse_args()
    if args.command == "compare":
        return compare(args.before, args.after)
    write(args.file, args.only, args.seconds)
    return 0


if __name__ == "__main__":
    sys.exit(main())
