"""Trains a policy: updates, evaluations, checkpoints, and when it ends."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, Protocol

import numpy as np
import torch
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import Logger
from stable_baselines3.common.on_policy_algorithm import OnPolicyAlgorithm

from volery.autonomy.policy.description import TrainingRecord
from volery.autonomy.policy.policy_file import Policy
from volery.core.errors import VoleryError
from volery.learning.adapters.stable_baselines import StableBaselinesEnv
from volery.learning.task import Task
from volery.learning.training.algorithm_state import algorithm_state, restore_algorithm_state
from volery.learning.training.algorithms import make_algorithm
from volery.learning.training.checkpoint import (
    Checkpoint,
    check_task,
    read_checkpoint,
    write_checkpoint,
)
from volery.learning.training.configuration import TrainingConfiguration
from volery.learning.training.evaluation import VALIDATION_SEEDS, Evaluation, Evaluator
from volery.learning.training.policy_export import (
    Arrays,
    greedy_actions,
    network_arrays,
    policy_of,
)
from volery.learning.training.records import CurvePoint, EpisodesPoint, Latest
from volery.learning.vector_env import TaskVectorEnv

Ending = Literal["target", "steps", "seconds", "interrupted"]
_CHECKPOINT_PERIOD_S = 60.0
_POINTS = 100
"""Points of the curve of a training's own episodes."""
SEED_SPACING = 1 << 16
"""Seeds of the environments of one training; those of the next seed follow."""


@dataclass(frozen=True)
class TrainingResult:
    """Result of a training."""

    policy: Policy
    """The policy of the best evaluation."""
    ending: Ending
    steps: int
    seconds: float
    success: float
    """Fraction of validation episodes in which `policy` succeeds."""
    curve: tuple[CurvePoint, ...]
    """Evaluations."""
    episodes: tuple[EpisodesPoint, ...]
    """Results of the training's own episodes, a hundred times in `steps` decisions."""


class TrainingMonitor(Protocol):
    """Monitors a training, for progress bars and logs."""

    def on_update(self, trainer: Trainer) -> None:
        """Called before each rollout."""

    def on_evaluation(self, trainer: Trainer, evaluation: Evaluation) -> None:
        """Called after each evaluation."""

    def close(self) -> None:
        """Called at the end."""


@dataclass
class _Progress:
    """What a training keeps beside the algorithm."""

    latest: Latest
    seconds: float = 0.0
    next_evaluation: int = 0
    best: Arrays | None = None
    best_score: tuple[float, float] = (-1.0, -np.inf)
    best_steps: int = 0
    curve: list[CurvePoint] = field(default_factory=list)
    episodes: list[EpisodesPoint] = field(default_factory=list)


class _End(Exception):  # noqa: N818  (no error)
    def __init__(self, ending: Ending) -> None:
        self.ending: Ending = ending


class Trainer:
    """Trains a policy for `task`.

    checkpoint: file that is written now and then and at the end; None for none. Raises
    `VoleryError` if the algorithm does not fit the task. Call `close` at the end.
    """

    def __init__(
        self,
        task: Task,
        configuration: TrainingConfiguration,
        *,
        checkpoint: Path | None = None,
        monitors: Sequence[TrainingMonitor] = (),
    ) -> None:
        self.task = task
        self.configuration = configuration
        self.checkpoint = checkpoint
        self.monitors = monitors
        self.is_interrupted = False
        """Set this to end the training before its next rollout."""
        torch.set_num_threads(configuration.torch_threads)
        envs = TaskVectorEnv(task, configuration.num_envs, threads=configuration.threads)
        self.env = StableBaselinesEnv(
            envs,
            reward_scale=configuration.reward_scale,
            marks_timeouts=configuration.algorithm != "ppo",
        )
        try:
            self.algorithm: BaseAlgorithm = make_algorithm(configuration, self.env)
        except BaseException:
            self.env.close()
            raise
        self.env.seed(configuration.seed * SEED_SPACING)
        self.algorithm.set_logger(Logger(folder=None, output_formats=[]))
        self._evaluator: Evaluator | None = None
        self._progress = _Progress(Latest.of(self.env.num_envs, [r.name for r in task.rewards]))
        self._progress.next_evaluation = configuration.evaluation_period
        self._began = self._saved = time.monotonic()
        self._before_s = 0.0

    # ------------------------------------------------------------------------------------- state

    @property
    def steps(self) -> int:
        """Decisions of all environments so far."""
        return int(self.algorithm.num_timesteps)

    @property
    def seconds(self) -> float:
        """Wall time of the training so far, s, without interruptions."""
        return self._before_s + time.monotonic() - self._began

    @property
    def latest(self) -> Latest:
        """Results of the episodes that ended lately."""
        return self._progress.latest

    @property
    def curve(self) -> Sequence[CurvePoint]:
        """Evaluations so far."""
        return self._progress.curve

    # ----------------------------------------------------------------------------------- training

    def run(self) -> TrainingResult:
        """Trains until the target, the limits or an interruption, and returns the best policy."""
        self._began = self._saved = time.monotonic()
        ending: Ending = "steps"
        left = self.configuration.steps - self.steps
        try:
            if left > 0:
                self.algorithm.learn(
                    left,
                    callback=_Callback(self),
                    log_interval=None,  # type: ignore[arg-type]  # allowed: none
                    reset_num_timesteps=False,
                )
            if not self.curve or self.curve[-1].steps < self.steps:
                ending = "target" if self._evaluate() else "steps"
        except _End as end:
            ending = end.ending
            if self._progress.best is None:
                self._evaluate()
        self._save()
        best, success = self._progress.best, self._progress.best_score[0]
        assert best is not None
        return TrainingResult(
            self._policy(best),
            ending,
            self.steps,
            self.seconds,
            success,
            tuple(self.curve),
            tuple(self._progress.episodes),
        )

    def act(self, observation: np.ndarray) -> np.ndarray:
        """Returns the greedy actions of the present policy."""
        return greedy_actions(self.algorithm, observation)

    def resume(self, path: Path) -> None:
        """Continues from a checkpoint.

        Raises `VoleryError` if it is of another task, algorithm or configuration, or damaged.
        """
        found = read_checkpoint(path)
        check_task(found, self.task.name, path)
        if found.algorithm != self.configuration.algorithm:
            raise VoleryError(
                f"{path}: the checkpoint is of algorithm '{found.algorithm}', not "
                f"'{self.configuration.algorithm}'"
            )
        try:
            restore_algorithm_state(self.algorithm, self.env, found.state["algorithm"])
        except VoleryError as error:
            raise VoleryError(f"{path}: {error}") from None
        self._progress = _Progress(**found.state["progress"])
        self._before_s = self._progress.seconds

    def close(self) -> None:
        """Releases the environments and ends the monitors."""
        self.env.close()
        if self._evaluator is not None:
            self._evaluator.close()
        for monitor in self.monitors:
            monitor.close()

    # ------------------------------------------------------------------------------------- inside

    def between_updates(self) -> None:
        """Evaluates and saves if it is time to; raises `_End` if the training ends."""
        configuration, progress = self.configuration, self._progress
        for monitor in self.monitors:
            monitor.on_update(self)
        self.algorithm.logger.dump(self.steps)
        if self.steps * _POINTS >= (len(progress.episodes) + 1) * configuration.steps:
            latest = self.latest
            progress.episodes.append(EpisodesPoint(self.steps, latest.success, latest.mean_return))
        if self.steps >= progress.next_evaluation:
            success = self.latest.success
            if np.isnan(success) or success >= configuration.evaluation_from:
                progress.next_evaluation = self.steps + configuration.evaluation_period
                if self._evaluate():
                    raise _End("target")
        if self.is_interrupted:
            raise _End("interrupted")
        if 0.0 < configuration.seconds <= self.seconds:
            raise _End("seconds")
        if time.monotonic() - self._saved > _CHECKPOINT_PERIOD_S:
            self._save()

    def _evaluate(self) -> bool:
        """Evaluates the present policy, keeps the best; returns whether it reaches the target."""
        configuration, progress = self.configuration, self._progress
        if self._evaluator is None:
            self._evaluator = Evaluator(
                self.task,
                configuration.evaluation_episodes,
                seed=VALIDATION_SEEDS,
                threads=configuration.threads,
            )
        found = self._evaluator.run(self.act)
        progress.curve.append(
            CurvePoint(self.steps, self.seconds, found.success, found.mean_return)
        )
        score = (found.success, found.mean_return)
        if score > progress.best_score or progress.best is None:
            progress.best, progress.best_score = network_arrays(self.algorithm), score
            progress.best_steps = self.steps
        for monitor in self.monitors:
            monitor.on_evaluation(self, found)
        return found.success >= configuration.target_success

    def _save(self) -> None:
        self._progress.seconds = self.seconds
        if self.checkpoint is not None:
            state = {
                "algorithm": algorithm_state(self.algorithm, self.env),
                "progress": {
                    name: getattr(self._progress, name) for name in _Progress.__dataclass_fields__
                },
            }
            configuration = self.configuration
            write_checkpoint(
                self.checkpoint,
                Checkpoint(
                    self.task.name, configuration.algorithm, configuration.model_dump(), state
                ),
            )
        self._saved = time.monotonic()

    def _policy(self, arrays: Arrays) -> Policy:
        configuration, progress = self.configuration, self._progress
        record = TrainingRecord(
            algorithm=configuration.algorithm,
            steps=progress.best_steps,
            seconds=round(self.seconds, 1),
            seed=configuration.seed,
            success=progress.best_score[0],
            episodes=configuration.evaluation_episodes,
        )
        return policy_of(self.task, configuration, arrays, record)


class _Callback(BaseCallback):
    """Connects the trainer with the loop of stable-baselines3."""

    def __init__(self, trainer: Trainer) -> None:
        super().__init__()
        self._trainer = trainer

    def _on_rollout_start(self) -> None:
        self._trainer.between_updates()

    def _on_step(self) -> bool:
        info = self._trainer.env.last_info
        if info:
            self._trainer.latest.add(info)
            if isinstance(self.model, OnPolicyAlgorithm):
                self._add_values(info)
        return True

    def _add_values(self, info: dict[str, Any]) -> None:
        """Adds the values of observations at time limits, of all environments at once."""
        rows = np.flatnonzero(self._trainer.env.last_truncated)
        if not len(rows):
            return
        policy = self.model.policy
        with torch.no_grad():
            last = policy.obs_to_tensor(info["final_obs"][rows])[0]
            values = policy.predict_values(last).numpy()[:, 0]  # type: ignore[operator]
        self.locals["rewards"][rows] += self.model.gamma * values  # type: ignore[attr-defined]
