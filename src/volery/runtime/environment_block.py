"""Runs a block of environments: their UAVs are rows of one fleet in one engine and thread."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from volery.control.fleet import Fleet
from volery.control.fleet_variation import FleetParameters
from volery.control.flying_start import FlyingStart
from volery.core.clock import NS_PER_S
from volery.core.errors import CommandError, DivergenceError, SensorError
from volery.core.rng import stream_key
from volery.engine.engine import Engine, SensorBank
from volery.engine.events import Event
from volery.runtime.construction.estimation import build_estimation
from volery.runtime.construction.fleet import add_bodies, build_fleet
from volery.runtime.construction.sensor_suites import RESULT_OF, SensorInstance, fit_sensors, refit
from volery.runtime.construction.sensors import build_banks
from volery.runtime.environment_parameters import rows_of_environments
from volery.runtime.environment_streams import EnvironmentStreams
from volery.runtime.environment_worlds import EnvironmentWorlds, take_off
from volery.runtime.vehicles.flight_futures import CHECK_PERIOD_S, FlightFutures, FlightRuns
from volery.runtime.vehicles.sample_stream import SampleStream
from volery.runtime.vehicles.uav import Uav
from volery.runtime.vehicles.uav_sensors import UavSensors
from volery.scenario.schema import Scenario
from volery.sensors.bank import Bank
from volery.sensors.cameras.bank import CameraBank
from volery.sensors.cameras.camera import EVERY_PART, Part
from volery.sensors.mount import Mount
from volery.sensors.sample_rows import sample_of
from volery.sensors.samples import JointAngles, Samples
from volery.sensors.sensor_samples import SensorSample
from volery.world.weather.dryden import turbulence_stream
from volery.world.world_scenes import WorldScenes

SampleArrays: TypeAlias = dict[str, NDArray[Any]]


@dataclass(frozen=True)
class EnvironmentEvent:
    """Describes an event of one environment (`env`)."""

    env: int
    """Number of the environment."""
    event: Event
    """Event of a UAV of the environment."""


class EnvironmentBlock:
    """Runs the environments `first`, `first` + 1, ... of a scenario, one for each of `seeds`.

    runs: advances all environments, for code that waits for a flight command.
    """

    def __init__(
        self,
        scenario: Scenario,
        worlds: EnvironmentWorlds,
        seeds: Sequence[int],
        first: int,
        runs: FlightRuns,
    ) -> None:
        self.seeds = list(seeds)
        self._scenario = scenario
        self._worlds = worlds
        self._starts = worlds.world(0).starts
        self._first = first
        num_envs = len(self.seeds)
        begun = worlds.dealt(first, num_envs)
        all_starts = tuple(
            start for world in begun.tolist() for start in worlds.world(world).starts
        )
        names = tuple(f"{k}/{start.name}" for k in range(num_envs) for start in self._starts)
        self.fleet = build_fleet(scenario, all_starts, names, num_envs=num_envs)
        self._scene = worlds.scene.twin()
        add_bodies(self._scene, all_starts, num_envs=num_envs)
        self.world = begun.copy()
        """(num_envs,) number of the world of each environment."""
        self._begun = begun
        self._enter(np.arange(num_envs), begun)
        self._fitted = fit_sensors(scenario, self._starts)
        fitted = [f for k in range(num_envs) for f in self._fit(k)]
        estimation = build_estimation(scenario, fitted, self.fleet)
        self._engine = Engine(
            self.fleet,
            self._scene,
            worlds.terrain,
            build_banks(scenario, fitted, self.fleet, self._scene, estimation),
            names,
            self,
            crash_on_contact=scenario.physics.on_contact == "crash",
            estimation=estimation,
            num_envs=num_envs,
            fuses_ticks=True,
        )
        banks = self._engine.banks
        self._bank_of = {id(bank.sensors): k for k, bank in enumerate(banks)}
        self._sensor_rows = _rows_by_sensor(banks)
        self._latest: list[Samples | None] = [None] * len(banks)
        self._bank_uavs = [np.array([sensor.uav for sensor in bank.sensors]) for bank in banks]
        """By bank: (S,) row of the UAV of each sensor."""
        self._events: list[EnvironmentEvent] = []
        self._began_ns = np.zeros(num_envs, np.int64)
        self._mounts = {(f.id.uav_name, f.id.name): f.mount for f in self._fitted}
        self._is_old: dict[int, NDArray[np.bool_]] = {}
        """By bank: (S,) whether the last sample of a sensor is from before its reset."""
        self.futures = futures = FlightFutures(self._fleet_row_of, runs)
        self._engine.every(CHECK_PERIOD_S, futures.check, wanted=lambda: futures.needs_checks)
        self._streams = EnvironmentStreams(self._fitted, len(self._starts), banks, self.seeds)
        self._unstirred = np.ones(num_envs, np.bool_)
        """(num_envs,) whether the turbulence has not yet the stream of the present seed."""
        self._stir_air()
        self._landed_state = self.fleet.get_state()
        self._flying_state: dict[str, Any] | None = None
        self._is_estimated = estimation is not None
        self._take_off(np.arange(len(all_starts)))
        self._start_state = self._landed_state if self._is_estimated else self.fleet.get_state()

    # -------------------------------------------------------------------------------------- time

    @property
    def step(self) -> int:
        """Number of physics steps done."""
        return self.fleet.step

    @property
    def dt_ns(self) -> int:
        """Length of a physics step, ns."""
        return self.fleet.dt_ns

    @property
    def time_ns(self) -> int:
        """Simulated time since construction, ns."""
        return self._engine.time_ns

    @property
    def common_period_s(self) -> float:
        """Period after which control, batteries and all sensors fire together again, s."""
        periods = [Fraction(self.fleet.common_period_ns, NS_PER_S)]
        periods += [1 / bank.schedule.rate_hz for bank in self._engine.banks]
        down = math.lcm(*(p.denominator for p in periods))
        return math.lcm(*(int(p * down) for p in periods)) / down

    def age_s(self) -> NDArray[np.float64]:
        """Returns the simulated time (num_envs,), s, since the last reset of each environment."""
        return (self.time_ns - self._began_ns) / NS_PER_S

    def advance_to(self, step: int) -> None:
        """Advances to `step`. Raises `DivergenceError` with the environment that diverges."""
        try:
            self._engine.advance_to(step)
            self._engine.state_check.glance()
        except DivergenceError as error:
            raise self._of_copy(error) from None

    def reset(
        self,
        envs: NDArray[np.int64],
        seeds: Sequence[int] | None,
        motion: FlyingStart | None = None,
        worlds: NDArray[np.int64] | None = None,
    ) -> None:
        """Resets the environments `envs` (R,), numbered within the block.

        seeds: (R,) new ones, None for the present ones. motion: of the R * n UAVs, which then start
        in the air, None for the scenario's start. worlds: (R,) numbers of the worlds that they move
        to, None for the present ones.
        """
        if worlds is not None:
            self._enter(envs, worlds)
        rows = rows_of_environments(envs, len(self._starts))
        if motion is None:
            self._restart_on_ground(envs, rows)
        else:
            self.fleet.restart_in_flight(self._in_flight(), rows, motion)
        if seeds is not None:
            for k, seed in zip(envs.tolist(), seeds, strict=True):
                self.seeds[k] = seed
            self._streams.renew(envs)
            self._unstirred[envs] = True
        self._stir_air()
        self._engine.collisions.forget(rows)
        self._began_ns[envs] = self.time_ns
        if self.futures.has_pending:
            for path in self._paths_of(rows):
                self.futures.fail(path, "the environment was reset")
        self._mark_old(rows)
        for samples, fresh in self._engine.restart_sensors(rows, self._streams):
            self._renew(samples, fresh)
        if motion is None and self._is_estimated:
            self._take_off(rows)

    def vary(self, envs: NDArray[np.int64], parameters: FleetParameters) -> None:
        """Sets physical parameters of the R * n UAVs of the environments `envs` (R,)."""
        self.fleet.vary(rows_of_environments(envs, len(self._starts)), parameters)
        self._stir_air()

    def get_state(self) -> dict[str, Any]:
        """Returns everything that changes."""
        try:
            self._engine.state_check.look()
        except DivergenceError as error:
            raise self._of_copy(error) from None
        return {
            "engine": self._engine.get_state(),
            "latest": [saved_samples(samples) for samples in self._latest],
            "is_old": {bank: rows.copy() for bank, rows in self._is_old.items()},
            "events": list(self._events),
            "began": self._began_ns.copy(),
            "seeds": list(self.seeds),
            "world": self.world.copy(),
        }

    def set_state(self, state: dict[str, Any]) -> None:
        """Restores a state that `get_state` returned."""
        self.futures.fail_all("another state was restored")
        self._engine.set_state(state["engine"])
        pairs = zip(self._engine.banks, state["latest"], strict=True)
        self._latest = [restored_samples(bank, samples) for bank, samples in pairs]
        self._is_old = {bank: rows.copy() for bank, rows in state["is_old"].items()}
        self._events = list(state["events"])
        self._began_ns = state["began"].copy()
        self.seeds[:] = state["seeds"]
        self._enter(np.arange(len(self.seeds)), state["world"])
        self._streams.renew(np.arange(len(self.seeds)))
        self._unstirred[:] = True
        self._stir_air()

    def restore(self, envs: NDArray[np.int64], state: dict[str, Any]) -> None:
        """Restores the environments `envs` (R,) alone; see `VectorizedSimulation.set_state`.

        Raises `CommandError` for environments with sensors.
        """
        if self._engine.banks:
            raise CommandError("environments with sensors are restored all together")
        self._enter(envs, state["world"][envs])
        rows = rows_of_environments(envs, len(self._starts))
        fleet = state["engine"]["fleet"]
        self.fleet.restore(fleet, rows)
        self._engine.collisions.forget(rows)
        saved_ns = fleet["step"] * self.dt_ns
        self._began_ns[envs] = self.time_ns - (saved_ns - state["began"][envs])
        for env in envs.tolist():
            self.seeds[env] = state["seeds"][env]
        self._streams.renew(envs)
        self._unstirred[envs] = True
        self._stir_air()
        if self.futures.has_pending:
            for path in self._paths_of(rows):
                self.futures.fail(path, "another state was restored")

    # -------------------------------------------------------------------------------- observations

    def uav(self, env: int, name: str) -> Uav:
        """Returns the handle on one UAV."""
        index = [start.name for start in self._starts].index(name)
        row = env * len(self._starts) + index
        flight = self._scenario.types[self._starts[index].type_name].flight
        path = f"{self._first + env}/{name}"
        sensors = UavSensors(self, None, path)
        return Uav(self.fleet, row, name, flight, sensors=sensors, futures=self.futures, path=path)

    def latest_rows(
        self, uav: str, sensor: str
    ) -> tuple[Samples, NDArray[np.int64], NDArray[np.bool_]] | None:
        """Returns the last batch with a sensor, its rows (num_envs,) and whether each is new.

        A row is not new if its sample is from before the reset of its environment. None before the
        first sample.
        """
        bank, rows = self._sensor_rows[uav, sensor]
        batch = self._latest[bank]
        if batch is None:
            return None
        is_old = self._is_old.get(bank)
        is_new = np.ones(len(rows), np.bool_) if is_old is None else ~is_old[rows]
        return batch, rows, is_new

    # ------------------------------------------------------- samples of one UAV of one environment

    def names(self, uav: str) -> tuple[str, ...]:
        """Returns the names of the sensors of a UAV, `ENV/NAME`."""
        name = uav.rsplit("/", maxsplit=1)[-1]
        return tuple(sensor for own, sensor in self._sensor_rows if own == name)

    def latest(self, uav: str, sensor: str) -> SensorSample | None:
        """Returns the last sample of a sensor of a UAV, `ENV/NAME`, None before the first."""
        env, name = uav.split("/")
        found = self.latest_rows(name, sensor)
        number = int(env) - self._first
        if found is None or not found[2][number]:
            return None
        batch, rows, _ = found
        return sample_of(batch, int(rows[number]), self._mounts[name, sensor])

    def request(self, uav: str, sensor: str) -> None:
        """Does nothing: all sensors of environments measure."""

    def kind(self, uav: str, sensor: str) -> str:
        """Returns the kind of a sensor of a UAV, `NAME` or `ENV/NAME`, such as `gnss`."""
        name = uav.rsplit("/", maxsplit=1)[-1]
        return self._engine.banks[self._sensor_rows[name, sensor][0]].name

    def is_camera(self, uav: str, sensor: str) -> bool:  # noqa: ARG002 - as for all
        """Returns False: cameras of environments render without a reader."""
        return False

    def request_parts(self, uav: str, sensor: str, parts: Collection[Part]) -> None:
        """Renders only `parts` of a camera's images; see `EnvironmentSensor.request_parts`."""
        bank = getattr(self._engine.banks[self._sensor_rows[uav, sensor][0]], "bank", None)
        wanted = tuple(parts)
        if not isinstance(bank, CameraBank):
            raise SensorError(f"sensor '{sensor}' of {uav} is no camera: it has no parts of images")
        if not wanted or not set(wanted) <= set(EVERY_PART):
            raise SensorError(f"parts of images: some of {', '.join(EVERY_PART)}, not {parts!r}")
        bank.requested_parts = lambda: wanted

    def open_stream(self, uav: str, sensor: str, **_options: Any) -> SampleStream:
        """Raises `CommandError`: environments advance together."""
        raise CommandError(f"sensor '{sensor}' of {uav}: environments have no streams; use latest")

    def mount(self, uav: str, sensor: str) -> Mount:
        """Returns the mount of a sensor."""
        return self._mounts[uav, sensor]

    def sample(self, uav: str, sensor: str) -> SampleArrays | None:
        """Returns the last sample of one sensor of each environment; arrays are (num_envs, ...).

        Raises `CommandError` if there is no such sensor.
        """
        try:
            bank, rows = self._sensor_rows[uav, sensor]
        except KeyError:
            known = ", ".join(f"{uav} {sensor}" for uav, sensor in self._sensor_rows)
            raise CommandError(f"no sensor '{sensor}' of '{uav}'; known: {known}") from None
        samples = self._latest[bank]
        if samples is None:
            return None
        return {name: array[rows] for name, array in _arrays(samples).items()}

    def drain_events(self) -> list[EnvironmentEvent]:
        """Returns and clears the events since the last call."""
        events, self._events = self._events, []
        return events

    # ------------------------------------------------------------------------ the engine's sink

    def advanced(self, first_step: int, last_step: int) -> None:
        """Ignores computed steps."""

    def sampled(self, samples: Samples) -> None:
        """Stores the last samples of every bank."""
        bank = self._bank_of[id(samples.sensors)]
        self._latest[bank] = samples
        if self._is_old:
            self._is_old.pop(bank, None)

    def happened(self, event: Event) -> None:
        """Stores an event under its environment."""
        env, name = event.uav.split("/")
        partner = event.partner.split("/")[-1]
        own = replace(event, uav=name, partner=partner)
        number = self._first + int(env)
        if self.futures.has_pending:
            other = f"{number}/{partner}" if "/" in event.partner else partner
            self.futures.happened(replace(event, uav=f"{number}/{name}", partner=other))
        self._events.append(EnvironmentEvent(number, own))

    def deliver(self) -> None:
        """Does nothing: there is no message queue."""

    # ------------------------------------------------------------------------------------- inside

    def _fleet_row_of(self, path: str) -> tuple[Fleet, int]:
        env, name = path.split("/")
        names = [start.name for start in self._starts]
        return self.fleet, (int(env) - self._first) * len(names) + names.index(name)

    def _paths_of(self, rows: NDArray[np.int64]) -> list[str]:
        """Returns `ENV/NAME` of the UAVs `rows`."""
        envs, indices = np.divmod(rows, len(self._starts))
        return [
            f"{self._first + env}/{self._starts[index].name}"
            for env, index in zip(envs.tolist(), indices.tolist(), strict=True)
        ]

    def _mark_old(self, rows: NDArray[np.int64]) -> None:
        """Marks the samples of all sensors of the UAVs `rows`."""
        for bank, sampled in enumerate(self._latest):
            if sampled is None:
                continue
            uavs = self._bank_uavs[bank]
            is_old = self._is_old.setdefault(bank, np.zeros(len(uavs), np.bool_))
            is_old |= np.isin(uavs, rows)

    def _of_copy(self, error: DivergenceError) -> DivergenceError:
        """Returns the error with the environment's number among all, not in this block."""
        number, name = error.uav.split("/")
        env = self._first + int(number)
        text = str(error).replace(error.uav, f"{name} of environment {env}", 1)
        return DivergenceError(f"{env}/{name}", error.time_s, text)

    def _renew(self, samples: Samples, rows: NDArray[np.int64]) -> None:
        """Replaces the samples of restarted sensors."""
        bank = self._bank_of[id(samples.sensors)]
        last = self._latest[bank]
        if last is not None:
            changed: dict[str, Any] = {}
            for name, array in _arrays(last).items():
                changed[name] = array.copy()
                changed[name][rows] = _arrays(samples)[name][rows]
                changed[name].flags.writeable = False
            self._latest[bank] = replace(last, **changed)
            if bank in self._is_old:
                self._is_old[bank][rows] = False

    def _fit(self, env: int) -> list[SensorInstance]:
        return refit(self._fitted, self.seeds[env], env * len(self._starts))

    def _take_off(self, rows: NDArray[np.int64]) -> None:
        """Takes off with those of the UAVs `rows` that start with a take-off."""
        for row in rows.tolist():
            start = self._starts[row % len(self._starts)]
            if start.takes_off:
                take_off(self.fleet, row, start, self._scenario)

    def _enter(self, envs: NDArray[np.int64], worlds: NDArray[np.int64]) -> None:
        """Moves the environments `envs` (R,) to the worlds number `worlds` (R,)."""
        self.world[envs] = worlds
        if isinstance(self._scene, WorldScenes):
            self._scene.set_worlds(envs, worlds)

    def _restart_on_ground(self, envs: NDArray[np.int64], rows: NDArray[np.int64]) -> None:
        """Resets the UAVs `rows` of the environments `envs` to the start of their worlds."""
        own, begun = self.world[envs], self._begun[envs]
        used = np.union1d(own, begun).tolist()
        elsewhere = [world for world in used if self._worlds.has_own_start(world)]
        moved = (own != begun) & (np.isin(begun, elsewhere) | np.isin(own, elsewhere))
        num_uavs = len(self._starts)
        by_env = rows.reshape(len(envs), num_uavs)
        if not moved.all():
            self.fleet.restart(self._start_state, by_env[~moved].ravel())
        for world in np.unique(own[moved]).tolist():
            some = by_env[moved & (own == world)].ravel()
            state = self._worlds.start_state(world, takes_off=not self._is_estimated)
            self.fleet.restart(state, some, some % num_uavs)

    def _in_flight(self) -> dict[str, Any]:
        """Returns the state at step 0 in which all UAVs hold in the air."""
        if self._flying_state is None:
            present = self.fleet.get_state()
            self.fleet.set_state(self._landed_state)
            for row in range(len(self.fleet)):
                state = self.fleet.state
                self.fleet.put(row, state.position_map[row], state.attitude[row])
                self.fleet.push(row, np.zeros(3), np.zeros(3))
            self._flying_state = self.fleet.get_state()
            self.fleet.set_state(present)
        return self._flying_state

    def _stir_air(self) -> None:
        """Seeds the turbulence of environments with new seeds, once there is turbulence."""
        if not self.fleet.has_turbulence:
            return
        envs = np.flatnonzero(self._unstirred)
        self._unstirred[envs] = False
        num_uavs = len(self._starts)
        rows = envs[:, None] * num_uavs + np.arange(num_uavs)
        for index, start in enumerate(self._starts):
            name = turbulence_stream(start.name)
            keys = [stream_key(self.seeds[env], name) for env in envs.tolist()]
            self.fleet.set_turbulence_keys(rows[:, index], np.array(keys, np.uint64))


def _arrays(samples: Samples) -> dict[str, NDArray[Any]]:
    return {name: v for name, v in vars(samples).items() if isinstance(v, np.ndarray)}


def _rows_by_sensor(banks: Sequence[Bank]) -> dict[tuple[str, str], tuple[int, NDArray[np.int64]]]:
    """Returns the bank and rows of each sensor, by UAV name and sensor name."""
    indices: dict[tuple[str, str], tuple[int, list[int]]] = {}
    for k, bank in enumerate(banks):
        if bank.name == "joints":
            continue
        for row, sensor in enumerate(bank.sensors):
            indices.setdefault((sensor.uav_name, sensor.name), (k, []))[1].append(row)
    return {names: (k, np.array(rows)) for names, (k, rows) in indices.items()}


def saved_samples(samples: Samples | None) -> dict[str, Any] | None:
    """Returns the fields of samples that change, for `restored_samples`; arrays are not copied."""
    if samples is None:
        return None
    return {name: v for name, v in vars(samples).items() if name not in ("sensors", "model")}


def restored_samples(bank: SensorBank, fields: dict[str, Any] | None) -> Samples | None:
    """Returns the samples of `bank` that `saved_samples` saved."""
    if fields is None:
        return None
    model = getattr(getattr(bank, "bank", bank), "model", None)
    own = {"sensors": bank.sensors} | ({} if model is None else {"model": model})
    kind: type[Any] = JointAngles if bank.name == "joints" else RESULT_OF[bank.name]
    made: Samples = kind(**own, **fields)
    return made
