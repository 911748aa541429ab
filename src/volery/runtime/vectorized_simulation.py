"""Steps many independent environments of one scenario together, for learning and Monte Carlo.

All environments share one clock and a world, or a few worlds. Each has its own UAVs, noise and
wind, set by its own seed, and resets independently. Environments do not sense or touch one another.
Each thread runs one block of environments; the UAVs of a block are rows of one fleet, which one
compiled call moves.

    with VectorizedSimulation(load_scenario("hover"), 1024) as envs:
        envs.command_velocity(np.tile([1.0, 0.0, 0.0], (1024, 1, 1)))
        envs.run(0.1)
        height = envs.state().position_map[:, 0, 2]
        envs.reset(np.flatnonzero(height < 0.5))

There is no graph: commands and samples are arrays. The scenario's nodes do not run.
"""

from __future__ import annotations

import bisect
import itertools
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from volery.control.fleet import Fleet
from volery.core.arrays import Array
from volery.core.clock import ns_from_s, s_from_ns
from volery.core.errors import CommandError, ScenarioError
from volery.core.plurals import counted
from volery.runtime.checks import check_reset_seeds, check_seconds, check_steps
from volery.runtime.environment_block import EnvironmentBlock, EnvironmentEvent, SampleArrays
from volery.runtime.environment_parameters import EnvironmentParameters, rows_of_environments
from volery.runtime.environment_runs import EnvironmentRuns
from volery.runtime.environment_sensors import EnvironmentSensors
from volery.runtime.environment_start import EnvironmentStart
from volery.runtime.environment_worlds import EnvironmentWorlds
from volery.runtime.vehicles.batch_commands import BatchCommands, PresentState, joined_states
from volery.runtime.vehicles.flight_futures import FlightFutures
from volery.runtime.vehicles.uav import Uav
from volery.runtime.warmup.parallel_compilation import compiled
from volery.runtime.warmup.requirements import needs_of
from volery.scenario.schema import Scenario
from volery.vehicle.airframe import Airframe
from volery.vehicle.fleet import FleetState
from volery.world.city import City
from volery.world.forest import Forest
from volery.world.scene import Scene
from volery.world.terrain import Terrain


class VectorizedSimulation(BatchCommands):
    """Holds `num_envs` environments of `scenario`, each with `n` UAVs.

    Commands (`command_velocity`, `command_rates`, `go_to`, ...) take arrays (K, n, ...) for all
    environments.

    `seeds` has one seed per environment; the default is the scenario's seed and those after it.
    Results do not depend on the number of `threads`. By default all environments share the world
    that the scenario's seed generates: the attribute `scenario` has that world fixed
    (`world.seed`), and an environment with seed s equals `Simulation(envs.scenario.with_(seed=s))`.

    `worlds` has the seeds of several worlds, such as forests. Environment k starts in world number
    k modulo their number, and resets may move it to another. With seed s in the world with seed w
    it equals `Simulation(scenario.with_(seed=s, world={"seed": w}))`. Raises `ScenarioError` if the
    scenario, or one of the worlds, cannot be built.
    """

    scenario: Scenario
    """The scenario, with `world.seed` fixed to that of the first world."""
    terrain: Terrain
    """Ground of all environments."""
    city: City | None
    """Buildings and streets of the first world; None: there are none."""
    forest: Forest | None
    """Trees of the first world; None: there are none."""
    scene: Scene
    """Surfaces of all worlds, for rays and contacts."""

    def __init__(
        self,
        scenario: Scenario,
        num_envs: int,
        *,
        seeds: Sequence[int] | None = None,
        threads: int = 2,
        worlds: Sequence[int] | None = None,
    ) -> None:
        for what, number in (("num_envs", num_envs), ("threads", threads)):
            if number < 1:
                raise ScenarioError(f"{what} = {number}: at least 1 is needed")
        if seeds is None:
            seeds = range(scenario.seed, scenario.seed + num_envs)
        if len(seeds) != num_envs:
            raise ScenarioError(_without_seeds(num_envs, len(seeds)))
        scenario = scenario.with_(world={"seed": worlds[0] if worlds else scenario.world_seed})
        self.scenario = scenario
        self.worlds = (scenario.world_seed,) if worlds is None else tuple(worlds)
        """Seeds of the worlds that environments can be in."""
        with compiled(needs_of(scenario, nodes=False)):
            built = EnvironmentWorlds(scenario, self.worlds)
        first = built.world(0)
        self.terrain, self.city, self.forest = built.terrain, first.city, first.forest
        self.scene, self._starts = built.scene, first.starts
        ends = np.linspace(0, num_envs, min(threads, num_envs) + 1).round().astype(int).tolist()
        self._runs = EnvironmentRuns(
            self.step, lambda: (self._blocks[0].step, self._blocks[0].dt_ns)
        )
        self._blocks = [
            EnvironmentBlock(scenario, built, seeds[a:b], a, self._runs)
            for a, b in itertools.pairwise(ends)
        ]
        self._first: list[int] = ends[:-1]
        self.sensors = MappingProxyType(
            {start.name: EnvironmentSensors(self._blocks, start.name) for start in self._starts}
        )
        """Sensors by UAV and name: `envs.sensors["uav1"]["imu"].latest`, arrays (K, ...)."""
        self._uavs: list[Uav] = []
        self._owed_ns = 0
        self._closed = False
        self._pool = ThreadPoolExecutor(len(self._blocks), thread_name_prefix="volery-envs")

    # -------------------------------------------------------------------------------------- time

    @property
    def num_envs(self) -> int:
        """Number of environments, K."""
        return sum(len(block.seeds) for block in self._blocks)

    @property
    def uav_names(self) -> tuple[str, ...]:
        """Names of the n UAVs of each environment."""
        return tuple(start.name for start in self._starts)

    @property
    def airframes(self) -> tuple[Airframe, ...]:
        """Airframes of the n UAVs of each environment."""
        return tuple(start.airframe for start in self._starts)

    @property
    def dt_ns(self) -> int:
        """Length of a physics step, ns."""
        return self._blocks[0].dt_ns

    @property
    def time_ns(self) -> int:
        """Simulated time since construction, ns; resets do not change it."""
        return self._blocks[0].time_ns

    @property
    def time_s(self) -> float:
        """Simulated time since construction, s."""
        return s_from_ns(self.time_ns)

    @property
    def age_s(self) -> Array:
        """Simulated time (K,), s, of each environment since its start or last reset."""
        return np.concatenate([block.age_s() for block in self._blocks])

    @property
    def world(self) -> NDArray[np.int64]:
        """World (K,) of each environment: whole numbers, among `worlds`."""
        return np.concatenate([block.world for block in self._blocks])

    @property
    def common_period_s(self) -> float:
        """Period, s, after which control, batteries and all sensors fire together.

        A reset at a multiple of this period is exact. At another time, state and noise equal those
        of a fresh environment too, but control, batteries and sensors keep the phase common to all.
        """
        return self._blocks[0].common_period_s

    def step(self, steps: int = 1) -> None:
        """Advances all environments by physics steps. Raises `CommandError` if closed."""
        self._check_open()
        check_steps(steps)
        target = self._blocks[0].step + steps
        with self._runs.stepping():
            others = [self._pool.submit(block.advance_to, target) for block in self._blocks[1:]]
            self._blocks[0].advance_to(target)
            for other in others:
                other.result()

    def run(self, seconds: float) -> None:
        """Advances by `seconds`; a remaining part of a step counts for the next call."""
        self._check_open()
        check_seconds(seconds)
        dt_ns = self._blocks[0].dt_ns
        steps, self._owed_ns = divmod(self._owed_ns + ns_from_s(seconds), dt_ns)
        self.step(steps)

    def reset(
        self,
        envs: ArrayLike | None = None,
        seeds: Sequence[int] | None = None,
        *,
        start: EnvironmentStart | None = None,
        worlds: ArrayLike | None = None,
    ) -> None:
        """Resets `envs` (default: all), by numbers or mask (K,), optionally with new `seeds`.

        worlds: (R,) numbers of worlds among `self.worlds`, which the R environments move to; None
        for their present worlds. start: motion of their UAVs, which then start in the air; None for
        the scenario's start. Positions inside obstacles are not refused: the first step reports the
        collision.
        """
        chosen = self._chosen(envs)
        num_uavs = len(self._starts)
        motion = None if start is None else start.spread(len(chosen), num_uavs)
        check_reset_seeds(self.scenario, seeds or ())
        if seeds is not None and len(seeds) != len(chosen):
            raise CommandError(_without_seeds(len(chosen), len(seeds)))
        moved = None if worlds is None else self._checked_worlds(worlds, len(chosen))
        for block, first in zip(self._blocks, self._first, strict=True):
            here = np.flatnonzero((chosen >= first) & (chosen < first + len(block.seeds)))
            if len(here):
                own = None if seeds is None else [seeds[k] for k in here.tolist()]
                rows = (here[:, None] * num_uavs + np.arange(num_uavs)).ravel()
                part = None if motion is None else motion.rows(rows)
                there = None if moved is None else moved[here]
                block.reset(chosen[here] - first, own, part, there)

    def set_parameters(self, envs: ArrayLike | None, parameters: EnvironmentParameters) -> None:
        """Sets physical parameters of `envs` (R,), numbers or a mask (None: all).

        The fields of `parameters` name their units; resets do not change them.

        Call it before the reset at which they begin. An environment then equals a `Simulation`
        whose scenario has these values. Raises `CommandError` for values out of range.
        """
        chosen = self._chosen(envs)
        num_uavs = len(self._starts)
        every = parameters.spread(len(chosen), num_uavs)
        for block, first in zip(self._blocks, self._first, strict=True):
            here = np.flatnonzero((chosen >= first) & (chosen < first + len(block.seeds)))
            if len(here):
                own = every.rows(rows_of_environments(here, num_uavs))
                block.vary(chosen[here] - first, own)

    def get_state(self) -> list[Any]:
        """Returns the present state of all environments, for `set_state`."""
        return [self._owed_ns, *(block.get_state() for block in self._blocks)]

    def set_state(self, state: Sequence[Any], envs: ArrayLike | None = None) -> None:
        """Restores a state that `get_state` of this object returned.

        envs: numbers or mask (K,) of the environments that are restored, while time and the others
        go on; None: all, and the time. A part is restored exactly if the time since the state is a
        multiple of `common_period_s`. Raises `CommandError` for a part if there are sensors.
        """
        if envs is not None:
            chosen = self._chosen(envs)
            for block, first, saved in zip(self._blocks, self._first, state[1:], strict=True):
                here = chosen[(chosen >= first) & (chosen < first + len(block.seeds))]
                if len(here):
                    block.restore(here - first, saved)
            return
        self._owed_ns = state[0]
        for block, saved in zip(self._blocks, state[1:], strict=True):
            block.set_state(saved)

    def close(self) -> None:
        """Releases threads and scene memory; nothing can be simulated afterwards."""
        if not self._closed:
            self._closed = True
            self._pool.shutdown()
            self.scene.close()

    def __repr__(self) -> str:
        closed = ", closed" if self._closed else ""
        return (
            f"<VectorizedSimulation '{self.scenario.name}': "
            f"{counted(self.num_envs, 'environment')} of {counted(len(self._starts), 'UAV')}, "
            f"{self.time_s:.3f} s{closed}>"
        )

    def __enter__(self) -> VectorizedSimulation:
        return self

    def __exit__(self, *_exception: object) -> None:
        self.close()

    # -------------------------------------------------------------------------------- observations

    def state(self) -> FleetState:
        """Returns copies of the present states of all UAVs; each array is (K, n, ...)."""
        return joined_states([block.fleet.state for block in self._blocks], self._batch_shape)

    def present_state(self) -> PresentState:
        """Returns the fields of `state()`, each copied when it is read first."""
        return PresentState([block.fleet.state for block in self._blocks], self._batch_shape)

    @property
    def modes(self) -> NDArray[np.int64]:
        """Flight modes (K, n) of all UAVs, numbers of `FlightMode`."""
        modes = [block.fleet.modes for block in self._blocks]
        return np.concatenate(modes).reshape(self._batch_shape)

    def sample(self, uav: str, sensor: str) -> SampleArrays | None:
        """Returns the last sample of one sensor of each environment, None before the first.

        Arrays are (K, ...), with the field names of `sensors.samples`: `sample["ranges"]`. Raises
        `CommandError` if there is no such sensor.
        """
        parts = [block.sample(uav, sensor) for block in self._blocks]
        found = [part for part in parts if part is not None]
        if not found:
            return None
        return {name: np.concatenate([part[name] for part in found]) for name in found[0]}

    def drain_events(self) -> list[EnvironmentEvent]:
        """Returns and clears the events since the last call, sorted by time and environment."""
        events = [event for block in self._blocks for event in block.drain_events()]
        return sorted(events, key=lambda e: (e.event.time_ns, e.env))

    def uav(self, env: int, name: str) -> Uav:
        """Returns the handle on one UAV of environment number `env`."""
        self._chosen([env])
        k = bisect.bisect_right(self._first, env) - 1
        return self._blocks[k].uav(env - self._first[k], name)

    # ----------------------------------------------------------------------------------- inside

    @property
    def _batch_shape(self) -> tuple[int, ...]:
        return self.num_envs, len(self._starts)

    def _handles(self) -> Sequence[Uav]:
        if not self._uavs:
            names = self.uav_names
            self._uavs = [self.uav(env, name) for env in range(self.num_envs) for name in names]
        return self._uavs

    def _paths(self) -> Sequence[str]:
        return [f"{env}/{name}" for env in range(self.num_envs) for name in self.uav_names]

    def _fleets(self) -> Sequence[tuple[Fleet, slice]]:
        self._check_open()
        num_uavs = len(self._starts)
        return [
            (block.fleet, slice(first * num_uavs, (first + len(block.seeds)) * num_uavs))
            for block, first in zip(self._blocks, self._first, strict=True)
        ]

    def _future_lists(self) -> Sequence[FlightFutures]:
        return [block.futures for block in self._blocks]

    def _checked_worlds(self, worlds: ArrayLike, count: int) -> NDArray[np.int64]:
        """Returns numbers of worlds (count,)."""
        numbers = np.atleast_1d(np.asarray(worlds))
        wanted = f"{counted(count, 'environment')} need as many numbers of worlds"
        if numbers.shape != (count,) or not np.issubdtype(numbers.dtype, np.integer):
            raise CommandError(f"worlds: {wanted}, not {worlds!r}")
        if count and not 0 <= numbers.min() <= numbers.max() < len(self.worlds):
            raise CommandError(f"worlds are numbered 0 to {len(self.worlds) - 1}")
        return numbers.astype(np.int64)

    def _check_open(self) -> None:
        if self._closed:
            raise CommandError("the environments are closed; make a new VectorizedSimulation")

    def _chosen(self, envs: ArrayLike | None) -> NDArray[np.int64]:
        chosen = np.arange(self.num_envs) if envs is None else np.atleast_1d(np.asarray(envs))
        if chosen.dtype == bool:
            if chosen.shape != (self.num_envs,):
                raise CommandError(
                    f"a mask of environments has shape ({self.num_envs},), not {chosen.shape}"
                )
            chosen = np.flatnonzero(chosen)
        if len(chosen) and (chosen.ndim != 1 or not np.issubdtype(chosen.dtype, np.integer)):
            raise CommandError(f"environments are given by whole numbers or a mask, not {envs!r}")
        if len(chosen) and not 0 <= chosen.min() <= chosen.max() < self.num_envs:
            raise CommandError(f"environments are numbered 0 to {self.num_envs - 1}")
        return chosen.astype(np.int64)


def _without_seeds(num_envs: int, seeds: int) -> str:
    return (
        f"{counted(num_envs, 'environment', 'environments')} with "
        f"{counted(seeds, 'seed')}: each needs one"
    )
