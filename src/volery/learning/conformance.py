"""Checks that the environments of a task keep the rules: `check_task`.

Gymnasium's `check_env` knows single environments only; this is its counterpart for vectorized ones.
Episodes are cut to a few decisions, so that a check takes about a second.
"""

from __future__ import annotations

import pickle
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from gymnasium.spaces import Discrete
from gymnasium.vector import AutoresetMode
from numpy.typing import ArrayLike, NDArray

from volery.core.errors import CommandError, VoleryError
from volery.learning.single_env import TaskEnv
from volery.learning.task import Task
from volery.learning.vector_env import TaskVectorEnv

_SEED = 7


class ConformanceError(VoleryError):
    """A rule that an environment breaks."""


class _Step(NamedTuple):
    observation: NDArray[np.float32]
    reward: NDArray[np.float64]
    terminated: NDArray[np.bool_]
    truncated: NDArray[np.bool_]
    info: dict[str, Any]

    @property
    def over(self) -> NDArray[np.bool_]:
        return self.terminated | self.truncated


def check_task(
    task: Task | Callable[[], Task],
    *,
    num_envs: int = 3,
    episode_decisions: int = 6,
    checks: tuple[str, ...] | None = None,
) -> None:
    """Raises `ConformanceError` for the first rule of `CHECKS` that the task's environments break.

    task: a task, or a function without arguments that returns it and that `pickle` can name, such
    as one of a module; only then pickling is checked. num_envs: K of the vectorized environments.
    episode_decisions: decisions of an episode during the checks. checks: names in `CHECKS`; None:
    all.
    """
    whole = task if isinstance(task, Task) else task().made_by(task)
    subject = _Subject(whole, num_envs, episode_decisions)
    for name in CHECKS if checks is None else checks:
        CHECKS[name](subject)


class _Subject:
    """The environments of a task under test."""

    def __init__(self, task: Task, num_envs: int, decisions: int) -> None:
        self.task = task
        self.name = f"task '{task.name}'"
        self.short = replace(task, episode_s=decisions / task.decision_rate_hz)
        self.num_envs = num_envs
        self.rows = num_envs * task.num_agents
        self.decisions = 2 * decisions + 2

    @contextmanager
    def many(self, num_envs: int = 0, **options: Any) -> Iterator[TaskVectorEnv]:
        """Makes vectorized environments, and closes them."""
        env = TaskVectorEnv(self.short, num_envs or self.num_envs, **options)
        try:
            yield env
        finally:
            env.close()

    def actions(self, env: TaskVectorEnv, seed: int = _SEED) -> list[NDArray[Any]]:
        """Returns random actions (K * m, ...) for each decision, the same for the same seed."""
        env.action_space.seed(seed)
        return [env.action_space.sample() for _ in range(self.decisions)]

    def play(self, env: TaskVectorEnv, actions: list[NDArray[Any]]) -> list[_Step]:
        """Returns what a reset and the actions bring."""
        observation, info = env.reset(seed=_SEED)
        nothing = np.zeros(env.num_envs)
        steps = [_Step(observation, nothing, nothing > 1.0, nothing > 1.0, info)]
        return steps + [_Step(*env.step(action)) for action in actions]

    def equal(self, what: str, found: ArrayLike, expected: ArrayLike) -> None:
        """Raises `ConformanceError` unless both arrays are equal to the byte."""
        one, other = np.asarray(found), np.asarray(expected)
        if one.shape != other.shape or not np.array_equal(one, other):
            apart = "their shapes differ"
            if one.shape == other.shape:
                where = np.argwhere(one != other)[0].tolist()
                apart = f"at {where}: {one[tuple(where)]} and {other[tuple(where)]}"
            raise ConformanceError(f"{self.name}: {what} ({apart})")

    def require(self, holds: bool, what: str) -> None:
        """Raises `ConformanceError` unless `holds`."""
        if not holds:
            raise ConformanceError(f"{self.name}: {what}")

    def refuses(self, use: Callable[[], object], what: str) -> None:
        """Raises `ConformanceError` unless `use` raises `CommandError`."""
        try:
            use()
        except CommandError:
            return
        raise ConformanceError(f"{self.name}: {what}")

    def same_steps(self, what: str, found: list[_Step], expected: list[_Step]) -> None:
        """Raises `ConformanceError` unless observations, rewards and ends are equal."""
        for k, (one, other) in enumerate(zip(found, expected, strict=True)):
            for name in _Step._fields[:-1]:
                self.equal(f"{what}: {name} of step {k}", getattr(one, name), getattr(other, name))


# ------------------------------------------------------------------------------------------ checks


def _spaces(subject: _Subject) -> None:
    """Observations and actions lie in their spaces; arrays have the types of Gymnasium."""
    with subject.many() as env:
        subject.require(env.num_envs == subject.rows, "num_envs is not environments times UAVs")
        mode = env.metadata["autoreset_mode"]
        subject.require(mode is AutoresetMode.SAME_STEP, "metadata lack the autoreset mode")
        for k, step in enumerate(subject.play(env, subject.actions(env))):
            inside = env.observation_space.contains(step.observation)
            subject.require(inside, f"the observation of step {k} is not in its space")
            subject.require(step.reward.dtype == np.float64, "rewards are not float64")
            subject.require(bool(np.isfinite(step.reward).all()), f"reward of step {k} not finite")
            for ends in (step.terminated, step.truncated):
                subject.require(
                    ends.dtype == np.bool_ and ends.shape == (subject.rows,),
                    "ends are not booleans, one for each row",
                )


def _seeds(subject: _Subject) -> None:
    """Equal seeds give equal bytes with any number of threads; other seeds give others."""
    with subject.many(threads=1) as env, subject.many(threads=3) as other:
        actions = subject.actions(env)
        first = subject.play(env, actions)
        subject.same_steps("threads change the result", subject.play(other, actions), first)
        again = subject.play(env, actions)
        subject.same_steps("a reset with the same seed differs", again, first)
        apart, _ = env.reset(seed=_SEED + 1000)
        moved = env.step(actions[0])[0]
        differs = (apart != first[0].observation).any() or (moved != first[1].observation).any()
        subject.require(bool(differs), "another seed gives the same episode")


def _singles(subject: _Subject) -> None:
    """A batch of one equals the single environment, and each of many equals a single one."""
    agents = subject.task.num_agents
    with subject.many() as env:
        actions = subject.actions(env)
        steps = subject.play(env, actions)
    for k in range(subject.num_envs):
        rows = slice(k * agents, (k + 1) * agents)
        with subject.many(1) as alone:
            observation, _ = alone.reset(seed=_SEED + k)
            subject.equal(
                f"environment {k} begins unlike one", steps[0].observation[rows], observation
            )
            for i, action in enumerate(actions):
                own, step = _Step(*alone.step(action[rows])), steps[i + 1]
                for name in _Step._fields[:-1]:
                    what = f"environment {k} is unlike one: {name} of step {i + 1}"
                    subject.equal(what, getattr(step, name)[rows], getattr(own, name))
    if agents == 1:
        _compare_single(subject, actions, steps)


def _compare_single(subject: _Subject, actions: list[NDArray[Any]], steps: list[_Step]) -> None:
    single = TaskEnv(subject.short)
    begun, _ = single.reset(seed=_SEED)
    subject.equal("the single environment begins differently", begun, steps[0].observation[0])
    for i, action in enumerate(actions):
        seen, reward, terminated, truncated, info = single.step(action[0])
        step = steps[i + 1]
        what = f"the single environment differs in step {i + 1}"
        subject.equal(what, (reward, terminated, truncated), [array[0] for array in step[1:4]])
        if terminated or truncated:
            subject.equal(what, seen, step.info["final_obs"][0])
            subject.equal(what, info["success"], step.info["success"][0])
            seen, _ = single.reset()
        subject.equal(what, seen, step.observation[0])
    single.close()


def _autoreset(subject: _Subject) -> None:
    """All three modes of automatic resets follow Gymnasium and bring the same episodes."""
    with subject.many() as env:
        actions = subject.actions(env)
        same = subject.play(env, actions)
    first = next((i for i, step in enumerate(same) if step.over.any()), None)
    if first is None:
        raise ConformanceError(f"{subject.name}: no episode ends by its time limit")
    over = same[first].over
    final = same[first].info["final_obs"]
    subject.equal("_final_obs is no mask of the ends", same[first].info["_final_obs"], over)
    with subject.many(autoreset_mode="NextStep") as env:
        later = subject.play(env, actions[: first + 1])
    subject.equal("NextStep: wrong last observation", later[first].observation[over], final[over])
    after = later[first + 1]
    subject.equal("NextStep: rewards of a reset", after.reward[over], 0.0 * after.reward[over])
    subject.require(not after.over[over].any(), "NextStep: the step of a reset ends an episode")
    expected = same[first].observation[over]
    subject.equal("NextStep: wrong first observation", after.observation[over], expected)
    with subject.many(autoreset_mode="Disabled") as env:
        steps = subject.play(env, actions[:first])
        subject.equal("Disabled: wrong last observation", steps[first].observation, final)
        what = "Disabled: a step after the end of an episode is not refused"
        subject.refuses(lambda: env.step(actions[first]), what)
        begun, _ = env.reset(options={"reset_mask": over})
        subject.equal("Disabled: wrong first observation", begun, same[first].observation)
        env.step(actions[first])


def _infos(subject: _Subject) -> None:
    """Infos of ended episodes: return, decisions, success, name of the end, reward terms."""
    task = subject.short
    names = {*(end.name for end in task.terminations), "time_limit"}
    with subject.many() as env:
        steps = subject.play(env, subject.actions(env))
    returns = np.zeros(subject.rows)
    for step in steps[1:]:
        returns += step.reward
        for row in np.flatnonzero(step.over).tolist():
            info = step.info
            apart = abs(info["episode_return"][row] - returns[row])
            subject.require(apart < 1e-9, "info['episode_return'] is not the sum of rewards")
            length = info["episode_length"][row]
            subject.require(1 <= length <= task.episode_decisions, "wrong length of an episode")
            end = info["end_name"][row]
            is_known = end in names and (end == "time_limit") == bool(step.truncated[row])
            subject.require(is_known, f"wrong name of an end: '{end}'")
            terms = sum(float(sums[row]) for sums in info["reward_terms"].values())
            ends = [0.0, *(float(e.reward) for e in task.terminations)]
            extra = min(abs(info["episode_return"][row] - terms - end) for end in ends)
            subject.require(extra < 1e-6, "the terms of the reward do not sum to the return")
            returns[row] = 0.0


def _buffers(subject: _Subject) -> None:
    """Returned arrays belong to the caller: they neither change later nor change the simulation."""
    with subject.many() as env:
        actions = subject.actions(env)
        expected = subject.play(env, actions)
        copies = [step.observation.copy() for step in expected]
        observation, _ = env.reset(seed=_SEED)
        observation[:] = 7.0
        for k, action in enumerate(actions):
            step = _Step(*env.step(action))
            subject.equal(f"step {k + 1} uses a returned array", step.observation, copies[k + 1])
            for array in step[:4]:
                array[:] = 1
            action[:] = 0
        for k, copy in enumerate(copies):
            subject.equal(f"a later step changes step {k}", expected[k].observation, copy)


def _states(subject: _Subject) -> None:
    """A restored state continues to the byte, also in chosen environments alone."""
    half = subject.decisions // 2
    agents = subject.task.num_agents
    with subject.many() as env:
        actions = subject.actions(env)
        subject.play(env, actions[:half])
        state = env.get_state()
        rest = [_Step(*env.step(action)) for action in actions[half:]]
        env.set_state(state)
        again = [_Step(*env.step(action)) for action in actions[half:]]
        subject.same_steps("a restored state goes on differently", again, rest)
        if any(env.episodes.envs.sensors.values()):
            return
        last = subject.num_envs - 1
        simulation = env.episodes.envs
        since = len(actions) - half
        while not _is_whole(since / subject.task.decision_rate_hz / simulation.common_period_s):
            env.step(actions[0])
            since += 1
        env.set_state(state, np.array([last]))
        rows = slice(last * agents, subject.rows)
        for k, action in enumerate(actions[half:]):
            found = env.step(action)[0][rows]
            what = f"a restored environment differs after {k + 1} steps"
            subject.equal(what, found, rest[k].observation[rows])


def _pickles(subject: _Subject) -> None:
    """Tasks and environments travel to other processes, with their state."""
    if not subject.task.is_picklable:
        return
    task = pickle.loads(pickle.dumps(subject.task))
    subject.require(task.name == subject.task.name, "its name changes in a pickle")
    env = TaskVectorEnv(subject.task, 2)
    twin = None
    try:
        actions = subject.actions(env)[:4]
        env.reset(seed=_SEED)
        env.step(actions[0])
        twin = pickle.loads(pickle.dumps(env))
        for action in actions[1:]:
            found, expected = twin.step(action), env.step(action)
            subject.equal("a pickled environment differs", found[0], expected[0])
    finally:
        env.close()
        if twin is not None:
            twin.close()


def _refusals(subject: _Subject) -> None:
    """Impossible actions, seeds and masks are refused, and so are closed environments."""
    with subject.many() as env:
        action = subject.actions(env)[0]
        subject.refuses(lambda: env.step(action), "a step before the first reset is not refused")
        subject.refuses(lambda: env.reset(seed=-1), "a negative seed is not refused")
        env.reset(seed=_SEED)
        wrong: dict[str, Any] = {
            "too few rows": action[:-1],
            "not a number": np.full(action.shape, np.nan),
            "text": [["up"]] * len(action),
        }
        if isinstance(env.single_action_space, Discrete):
            wrong["a choice beyond the last"] = np.full(action.shape, env.single_action_space.n)
            wrong["half a choice"] = np.full(action.shape, 0.5)
        for what, value in wrong.items():
            subject.refuses(lambda v=value: env.step(v), f"actions: {what} is not refused")  # type: ignore[misc]
        mask = {"reset_mask": np.ones(len(action) + 1, np.bool_)}
        subject.refuses(lambda: env.reset(options=mask), "a mask of a wrong size is not refused")
        env.step(action)
        env.close()
        env.close()
        subject.refuses(lambda: env.step(action), "a step of a closed environment is not refused")
        subject.refuses(env.reset, "a reset of a closed environment is not refused")


def _is_whole(number: float) -> bool:
    return abs(number - round(number)) < 1e-6


CHECKS: dict[str, Callable[[_Subject], None]] = {
    "spaces": _spaces,
    "seeds": _seeds,
    "singles": _singles,
    "autoreset": _autoreset,
    "infos": _infos,
    "buffers": _buffers,
    "states": _states,
    "pickles": _pickles,
    "refusals": _refusals,
}
"""The checks of `check_task`, by name."""
