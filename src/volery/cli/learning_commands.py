"""Commands of learning: train, evaluate, export-policy."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from volery.cli.error_reporting import guarded
from volery.cli.tables import print_table
from volery.cli.terminal import echo_line

_POLICY = typer.Argument(help="Shipped policy or .npz file.", metavar="POLICY")


@guarded
def train(
    task: Annotated[
        str,
        typer.Argument(help="Shipped task, module:function or file.py:function.", metavar="TASK"),
    ],
    algorithm: Annotated[
        str | None, typer.Option(help="Choose ppo, dqn or sac.", metavar="ALGORITHM")
    ] = None,
    seconds: Annotated[
        float | None, typer.Option(help="End after this wall time, s; 0: no limit.")
    ] = None,
    steps: Annotated[
        int | None, typer.Option(min=1, help="End after these decisions of all environments.")
    ] = None,
    seed: Annotated[int | None, typer.Option(min=0, help="Set the seed.")] = None,
    out: Annotated[
        Path | None, typer.Option(help="Write into this folder, not training/TASK.")
    ] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Continue the training in the folder.")
    ] = False,
    envs: Annotated[int | None, typer.Option(min=1, help="Number of environments.")] = None,
    threads: Annotated[int | None, typer.Option(min=1, help="Threads of the simulation.")] = None,
    config: Annotated[
        Path | None, typer.Option(help="Read the configuration from this TOML file.")
    ] = None,
    tensorboard: Annotated[bool, typer.Option(help="Write event files of TensorBoard.")] = True,
) -> None:
    """Train a policy for a task until it succeeds."""
    from volery.cli.train import train_and_write

    train_and_write(
        task,
        {
            "algorithm": algorithm,
            "seconds": seconds,
            "steps": steps,
            "seed": seed,
            "num_envs": envs,
            "threads": threads,
        },
        out=out,
        resume=resume,
        config=config,
        tensorboard=tensorboard,
    )


@guarded
def evaluate(
    policy: Annotated[str, _POLICY],
    episodes: Annotated[int, typer.Option(min=1, help="Number of episodes.")] = 200,
    seed: Annotated[int, typer.Option(min=0, help="Set the first seed.")] = 0,
    task: Annotated[
        str | None, typer.Option(help="Evaluate in this task, not the policy's own.")
    ] = None,
    threads: Annotated[int, typer.Option(min=1, help="Threads of the simulation.")] = 2,
    json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Evaluate a policy on episodes that no training uses."""
    _evaluate_and_show(policy, task, episodes=episodes, seed=seed, threads=threads, as_json=json)


def _evaluate_and_show(
    policy: str, task: str | None, *, episodes: int, seed: int, threads: int, as_json: bool
) -> None:
    """Evaluates a policy and prints a table, or one JSON object."""
    from json import dumps

    from volery.learning.training import evaluate as evaluate_policy

    found = evaluate_policy(policy, task=task, episodes=episodes, seed=seed, threads=threads)
    if as_json:
        echo_line(dumps(found.as_dict()))
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


@guarded
def export_policy(
    policy: Annotated[str, _POLICY],
    file: Annotated[Path, typer.Argument(help="Write this .onnx file.", metavar="FILE")],
) -> None:
    """Export a policy as ONNX."""
    from volery.learning.training.onnx_export import export_onnx

    echo_line(export_onnx(policy, file))
