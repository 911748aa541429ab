"""Drives one peer; runs with the peer's own interpreter and never imports volery.

python -I host.py SCRIPT REQUEST: loads SCRIPT and calls its `prepare(request)` with the JSON object
in the file REQUEST. It returns two functions: one that runs a round of work, and one that returns
facts for checking the work. Then the program responds to each line of standard input, a word, with
a line of JSON on standard output:

    versions   version of each package of request["packages"]
    round      {"seconds": s}: a round was run, and its duration
    facts      the script's facts
"""

from __future__ import annotations

import json
import os
import runpy
import sys
import time
from importlib.metadata import version
from typing import Any


def main(script: str, request_file: str) -> None:
    """Responds until standard input ends."""
    # peers print on standard output, so they keep it and the responses use a copy
    with os.fdopen(os.dup(1), "w", encoding="utf-8") as answers:
        os.dup2(2, 1)
        with open(request_file, encoding="utf-8") as file:
            request: dict[str, Any] = json.load(file)
        round_of_work, facts = runpy.run_path(script)["prepare"](request)
        for line in sys.stdin:
            word = line.strip()
            answer: dict[str, Any]
            if word == "versions":
                answer = {name: version(name) for name in request["packages"]}
            elif word == "round":
                start = time.perf_counter()
                round_of_work()
                answer = {"seconds": time.perf_counter() - start}
            elif word == "facts":
                answer = facts()
            else:
                raise ValueError(f"unknown word {word!r}; there are versions, round, facts")
            answers.write(json.dumps(answer) + "\n")
            answers.flush()


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2])
