"""Writes a training's scalars, histograms and short videos for TensorBoard."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
from tensorboard.compat.proto.summary_pb2 import Summary
from torch.utils.tensorboard import SummaryWriter

from volery.learning.training.evaluation import Evaluation
from volery.learning.training.policy_export import network_arrays
from volery.learning.training.trainer import Trainer
from volery.learning.training.video import film_episode, gif_of

_SCALAR_PERIOD_S = 1.0
_HISTOGRAM_PERIOD_S = 20.0
_VIDEO_PERIOD_S = 60.0


class TensorBoardLog:
    """Monitors a training and writes event files into a folder."""

    def __init__(self, folder: Path) -> None:
        self._writer = SummaryWriter(str(folder))
        self._scalars_at = self._histograms_at = time.monotonic()
        self._filmed_at = time.monotonic()
        self._steps = 0

    def on_update(self, trainer: Trainer) -> None:
        """Writes the latest results, at most once a second."""
        now = time.monotonic()
        if now - self._scalars_at < _SCALAR_PERIOD_S:
            return
        write, steps, latest = self._writer.add_scalar, trainer.steps, trainer.latest
        rate = (steps - self._steps) / (now - self._scalars_at)
        self._scalars_at, self._steps = now, steps
        write("time/steps_per_s", rate, steps)
        if latest.returns:
            write("episodes/return", latest.mean_return, steps)
            write("episodes/success", latest.success, steps)
            for name, mean in latest.mean_terms().items():
                write(f"rewards/{name}", mean, steps)
        for name, value in trainer.algorithm.logger.name_to_value.items():
            if np.isscalar(value):
                write(name, float(value), steps)  # type: ignore[arg-type]
        if now - self._histograms_at > _HISTOGRAM_PERIOD_S:
            self._histograms_at = now
            self._write_histograms(trainer)

    def on_evaluation(self, trainer: Trainer, evaluation: Evaluation) -> None:
        """Writes the results of an evaluation."""
        write, steps = self._writer.add_scalar, trainer.steps
        write("evaluation/success", evaluation.success, steps)
        write("evaluation/return", evaluation.mean_return, steps)
        write("evaluation/length_s", evaluation.mean_length_s, steps)
        for name, part in evaluation.ends.items():
            write(f"evaluation/ends_{name}", part, steps)
        if time.monotonic() - self._filmed_at > _VIDEO_PERIOD_S:
            self._filmed_at = time.monotonic()
            self._write_video(trainer)

    def close(self) -> None:
        """Writes what is left."""
        self._writer.close()

    def _write_histograms(self, trainer: Trainer) -> None:
        for name, array in network_arrays(trainer.algorithm).items():
            self._writer.add_histogram(f"weights/{name}", array, trainer.steps)
        actions = np.asarray(trainer.env.last_actions, np.float64).reshape(trainer.env.num_envs, -1)
        for k in range(actions.shape[1]):
            self._writer.add_histogram(f"actions/{k}", actions[:, k], trainer.steps)

    def _write_video(self, trainer: Trainer) -> None:
        """Writes an episode as an animated image; TensorBoard shows it as a video."""
        frames, rate_hz = film_episode(trainer.task, trainer.act)
        if not len(frames):
            return
        image = Summary.Image(
            height=frames.shape[1],
            width=frames.shape[2],
            colorspace=3,
            encoded_image_string=gif_of(frames, rate_hz),
        )
        summary = Summary(value=[Summary.Value(tag="evaluation/episode", image=image)])
        writer = self._writer._get_file_writer()  # type: ignore[no-untyped-call]
        writer.add_summary(summary, trainer.steps)
