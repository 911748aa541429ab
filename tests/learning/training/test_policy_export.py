"""Policy files and ONNX models act as the networks that were trained."""

import numpy as np
import pytest

from volery.autonomy.policy.description import TrainingRecord
from volery.autonomy.policy.policy_file import read_policy, write_policy
from volery.core.errors import VoleryError
from volery.learning.tasks import load_task
from volery.learning.training import evaluate
from volery.learning.training.onnx_export import export_onnx
from volery.learning.training.policy_export import network_arrays, policy_of
from volery.learning.training.trainer import Trainer


@pytest.fixture(params=[("hover", "ppo"), ("hover", "sac"), ("homing", "dqn"), ("homing", "ppo")])
def trainer(request, tiny):
    """Return a trainer before its training."""
    name, algorithm = request.param
    made = Trainer(load_task(name), tiny(algorithm=algorithm, activation="relu"))
    yield made
    made.close()


def test_files_and_models_act_as_the_network(trainer, tmp_path):
    onnx = pytest.importorskip("onnx.reference")
    arrays = network_arrays(trainer.algorithm)
    policy = policy_of(trainer.task, trainer.configuration, arrays, TrainingRecord())
    write_policy(tmp_path / "own.npz", policy)
    read = read_policy(tmp_path / "own.npz")
    size = trainer.task.observation_size
    observation = np.random.default_rng(0).uniform(-3, 3, (64, size)).astype(np.float32)
    own = trainer.act(observation).reshape(64, -1)
    np.testing.assert_allclose(read.network.act(observation), own, atol=1e-5)
    export_onnx(str(tmp_path / "own.npz"), tmp_path / "own.onnx")
    model = onnx.ReferenceEvaluator(str(tmp_path / "own.onnx"))
    (action,) = model.run(None, {"observation": observation})
    np.testing.assert_allclose(action.reshape(64, -1), own, atol=1e-5)
    if trainer.configuration.algorithm == "ppo":
        values = trainer.algorithm.policy.predict_values(
            trainer.algorithm.policy.obs_to_tensor(observation)[0]
        )
        np.testing.assert_allclose(
            read.network.evaluate(observation).value, values.detach().numpy()[:, 0], atol=1e-4
        )


def test_a_policy_of_another_task_is_refused(tiny):
    trainer = Trainer(load_task("homing"), tiny(algorithm="dqn"))
    arrays = network_arrays(trainer.algorithm)
    policy = policy_of(trainer.task, trainer.configuration, arrays, TrainingRecord())
    trainer.close()
    assert evaluate(policy, episodes=2, threads=1).task == "homing"
    with pytest.raises(
        VoleryError, match="of task 'homing' and does not fit task 'hover'"
    ) as caught:
        evaluate(policy, task="hover")
    assert "it observes goal_heading (3)" in str(caught.value)


def test_an_unknown_policy_is_one_line(tmp_path):
    with pytest.raises(VoleryError, match="no policy 'nothing'"):
        evaluate("nothing")
    with pytest.raises(VoleryError, match="no policy 'nothing'"):
        export_onnx("nothing", tmp_path / "a.onnx")
