"""`volery evaluate`: evaluates a policy and prints the result."""

from __future__ import annotations

import json

from volery.cli.tables import print_table
from volery.cli.terminal import echo_line


def evaluate_and_show(
    policy: str, task: str | None, *, episodes: int, seed: int, threads: int, as_json: bool
) -> None:
    """Evaluates a policy and prints a table, or one JSON object."""
    from volery.learning.training import evaluate

    found = evaluate(policy, task=task, episodes=episodes, seed=seed, threads=threads)
    if as_json:
        echo_line(json.dumps(found.as_dict()))
        return
    interval = f"{found.success_low:.1%} to {found.success_high:.1%}"
    rows = [
        ("success", f"{found.success:.1%}", f"95 % confidence: {interval}"),
        ("return", f"{found.mean_return:.3f}", ""),
        ("length", f"{found.mean_length_s:.2f} s", ""),
        *((f"reward {name}", f"{mean:.3f}", "") for name, mean in found.reward_terms.items()),
        *((f"ends: {name}", f"{part:.1%}", "") for name, part in found.ends.items()),
    ]
    title = f"{found.task}, {found.episodes} episodes"
    print_table((title, "mean", ""), rows, right=(1,))
