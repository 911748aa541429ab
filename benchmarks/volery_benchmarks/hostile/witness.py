"""Requests the simulation's time as an ordinary client, in its own process.

    python -m volery_benchmarks.hostile.witness ROSBRIDGE_PORT SECONDS

It sends fifty requests a second, at instants that do not depend on the responses, and prints for
each call its due time, the time of its response (s of the monotonic clock) and the simulated time.
"""

from __future__ import annotations

import json
import sys
import time

from websockets.sync.client import connect

PERIOD_S = 0.02
_LAST_ANSWER_S = 5.0


def ask(port: int, seconds: float) -> list[tuple[float, float, float]]:
    """Returns due time, response time and simulated time, s, of each answered call."""
    answered: list[tuple[float, float, float]] = []
    with connect(f"ws://127.0.0.1:{port}", compression=None, open_timeout=_LAST_ANSWER_S) as client:
        start, asked, count = time.monotonic(), 0, round(seconds / PERIOD_S)
        last = start + seconds + _LAST_ANSWER_S
        while len(answered) < count and time.monotonic() < last:
            due = start + asked * PERIOD_S
            if asked < count and time.monotonic() >= due:
                call = {"op": "call_service", "service": "/rosapi/get_time", "id": str(asked)}
                client.send(json.dumps(call))
                asked += 1
                continue
            wait_s = (due if asked < count else last) - time.monotonic()
            try:
                answer = json.loads(client.recv(timeout=max(wait_s, 0.0)))
            except TimeoutError:
                continue
            now, stamp = time.monotonic(), answer["values"]["time"]
            sim_s = stamp.get("sec", stamp.get("secs")) + 1e-9 * stamp.get(
                "nanosec", stamp.get("nsecs")
            )
            answered.append((start + int(answer["id"]) * PERIOD_S, now, sim_s))
    return answered


def main() -> None:
    """Runs the command line."""
    port, seconds = sys.argv[1:]
    try:
        answered = ask(int(port), float(seconds))
    except OSError:  # the server refuses connections, or has ended
        answered = []
    sys.stdout.write(json.dumps(answered))


if __name__ == "__main__":
    main()
