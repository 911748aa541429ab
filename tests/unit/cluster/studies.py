"""Small studies and executors for tests."""

from pathlib import Path

from volery.cluster.batches import BatchResult, Preparation
from volery.cluster.executor import BatchLoss
from volery.cluster.runs import RunResult, code_version, versions

TINY = {
    "name": "tiny",
    "scenario": "hover",
    "duration_s": 0.5,
    "repetitions": 2,
    "metrics": ["success", "distance_m"],
    "changes": {"world.wind.turbulence": "moderate"},
    "parameters": {
        "wind": {
            "key": "world.wind.velocity_m_s",
            "values": [[2.0, 0.0, 0.0], [6.0, 0.0, 0.0]],
        }
    },
}


def study_file(folder: Path, text: str = "", name: str = "study.toml") -> Path:
    """Writes a study of hover with further lines."""
    path = folder / name
    path.write_text(f'name = "small"\nscenario = "hover"\nduration_s = 0.5\n{text}')
    return path


class FakeExecutor:
    """Returns what `answer(run)` says: metrics, or a text for a worker that ends."""

    def __init__(self, answer, obstacle="one by one"):
        self.answer, self.obstacle = answer, obstacle
        self.batches, self.waiting = [], []

    num_workers = 1

    def __call__(self, _job):
        return self

    def prepare(self):
        return Preparation(versions(), self.obstacle, 4)

    def can_submit(self):
        return not self.waiting

    def submit(self, batch):
        self.batches.append(batch)
        self.waiting.append(batch)

    def collect(self, _timeout_s):
        batch = self.waiting.pop(0)
        answers = [self.answer(run) for run in batch.runs]
        for answer in answers:
            if isinstance(answer, str):
                return [BatchLoss(batch, answer)]
        results = tuple(
            self._result(run, answer) for run, answer in zip(batch.runs, answers, strict=True)
        )
        return [BatchResult(batch.number, results)]

    def _result(self, run, metrics):
        return RunResult(
            id=run.id,
            status="done",
            parameters=dict(run.values),
            seed=run.seed,
            version=code_version(),
            metrics=metrics,
            fingerprints=self.fingerprints,
            digest=f"digest of {run.seed}",
            wall_s=0.1,
        )

    fingerprints: dict = {}  # noqa: RUF012 - set by tests

    def states(self):
        return ()

    def close(self):
        pass
