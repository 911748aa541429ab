"""Draws curves of trainings: python docs/pictures/learning/curves.py training/TASK/record.json."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import matplotlib as mpl

mpl.use("svg")
import matplotlib.pyplot as plt

mpl.rcParams["svg.hashsalt"] = "volery"
mpl.rcParams["font.size"] = 9


def draw(record: dict, title: str, target: Path) -> None:
    """Draws success over decisions: of the training's own episodes, and of evaluations."""
    figure, axes = plt.subplots(figsize=(5.2, 2.4), layout="constrained")
    own, evaluated = record["episodes_curve"], record["curve"]
    axes.plot(
        [p["steps"] for p in own],
        [100 * p["success"] for p in own],
        color="#8aa4c8",
        label="episodes of the training, with exploration",
    )
    axes.plot(
        [p["steps"] for p in evaluated],
        [100 * p["success"] for p in evaluated],
        "o-",
        color="#1f4e9c",
        markersize=3,
        label="evaluations",
    )
    axes.set(xlabel="decisions of all environments", ylabel="success, %", title=title)
    axes.set_ylim(-3, 103)
    axes.set_xlim(left=0)
    axes.xaxis.set_major_formatter(lambda x, _: f"{x:,.0f}")
    axes.grid(alpha=0.3)
    axes.legend(loc="upper left", fontsize=7)
    figure.savefig(target, metadata={"Date": None})
    plt.close(figure)


def main() -> None:
    """Runs the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("records", type=Path, nargs="+", help="TASK.json or TASK/record.json")
    parser.add_argument("-o", "--out", type=Path, default=Path(__file__).parent)
    options = parser.parse_args()
    for path in options.records:
        record = json.loads(path.read_text(encoding="utf-8"))
        task = path.parent.name if path.stem == "record" else path.stem
        title = f"{task}: {record['algorithm'].upper()}, seed {record['seed']}"
        draw(record, title, options.out / f"{task}.svg")


if __name__ == "__main__":
    main()
