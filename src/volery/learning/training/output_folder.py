"""The folder of a training: policy, checkpoint, configuration, record and logs."""

from __future__ import annotations

import json
import math
import re
from dataclasses import asdict, dataclass
from pathlib import Path

from volery.autonomy.policy.policy_file import write_policy
from volery.core.errors import VoleryError, reason_of
from volery.core.whole_files import write_whole
from volery.learning.training.trainer import TrainingResult

_PARENT = Path("training")


@dataclass(frozen=True)
class OutputFolder:
    """Names of the files of one training."""

    folder: Path

    @property
    def policy(self) -> Path:
        """The best policy."""
        return self.folder / "policy.npz"

    @property
    def checkpoint(self) -> Path:
        """The state from which the training continues."""
        return self.folder / "checkpoint"

    @property
    def record(self) -> Path:
        """JSON of the result: ending, steps, seconds and the curve."""
        return self.folder / "record.json"

    @property
    def tensorboard(self) -> Path:
        """Folder of TensorBoard's event files."""
        return self.folder / "tensorboard"

    def create(self) -> None:
        """Makes the folder. Raises `VoleryError` if it cannot."""
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise VoleryError(
                f"{self.folder}: cannot make the folder: {reason_of(error)}"
            ) from None

    def write(self, result: TrainingResult) -> None:
        """Writes policy and record."""
        write_policy(self.policy, result.policy)
        record = {
            **result.policy.description.training.model_dump(),
            "ending": result.ending,
            "trained_steps": result.steps,
            "curve": [asdict(point) for point in result.curve],
            "episodes_curve": [
                asdict(point) for point in result.episodes if not math.isnan(point.mean_return)
            ],
        }
        write_whole(self.record, json.dumps(record, indent=1) + "\n")


def new_folder(task: str, out: Path | None) -> OutputFolder:
    """Returns the folder of a new training: `out`, or `training/TASK` with a free number.

    Raises `VoleryError` if `out` holds a training already.
    """
    if out is not None:
        if OutputFolder(out).checkpoint.exists():
            raise VoleryError(
                f"{out} holds a training: continue it by --resume, or choose another --out"
            )
        return OutputFolder(out)
    number = max([0, *_numbers(task)]) + 1
    return OutputFolder(_PARENT / (task if number == 1 else f"{task}-{number}"))


def last_folder(task: str, out: Path | None) -> OutputFolder:
    """Returns the folder of the training to resume: `out`, or the newest of `training/TASK`.

    Raises `VoleryError` if it has no checkpoint.
    """
    if out is None:
        numbers = _numbers(task)
        if not numbers:
            raise VoleryError(f"no training of '{task}' in {_PARENT}/: name its folder by --out")
        number = max(numbers)
        out = _PARENT / (task if number == 1 else f"{task}-{number}")
    found = OutputFolder(out)
    if not found.checkpoint.is_file():
        raise VoleryError(f"{out} has no checkpoint to resume from")
    return found


def _numbers(task: str) -> list[int]:
    """Returns the numbers of the folders of a task."""
    if not _PARENT.is_dir():
        return []
    pattern = re.compile(rf"{re.escape(task)}(?:-(\d+))?")
    matches = [pattern.fullmatch(path.name) for path in _PARENT.iterdir()]
    return [int(match[1] or 1) for match in matches if match]
