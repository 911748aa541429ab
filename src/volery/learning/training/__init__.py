"""Training of policies on stable-baselines3, their evaluation, checkpoints and export.

Belongs here: what turns a `Task` into a policy file. Needs `pip install "volery[train]"`; modules
load torch and stable-baselines3 only where they train.

    from volery.learning.training import train

    policy = train("homing", seconds=60.0).policy
    action = policy.act(observation)
"""

from volery.learning.training.packages import require_training

require_training()

from volery.learning.training.training import evaluate, train  # noqa: E402

__all__ = ["evaluate", "train"]
