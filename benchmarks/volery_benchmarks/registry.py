"""Lists the benches by name with their bounds, and defines the format of a result.

A bench is a module of this package with `measure() -> Measured`, or only its figures as a dict.
"""

from __future__ import annotations

import importlib
import json
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from volery.core.errors import VoleryError
from volery.core.machine import describe_machine, describe_versions


@dataclass(frozen=True)
class Bound:
    """Limit of a figure on a present-day machine with two cores."""

    value: float
    at_most: bool = False

    def holds(self, figure: float) -> bool:
        """Returns whether a figure is within the bound."""
        return figure <= self.value if self.at_most else figure >= self.value

    def __str__(self) -> str:
        return f"{'<=' if self.at_most else '>='} {self.value:,.4g}"


@dataclass(frozen=True)
class Measured:
    """Holds the figures of a bench.

    `failures` maps figures that could not be measured to the reason; `versions` lists other
    software that took part.
    """

    figures: Mapping[str, float]
    failures: Mapping[str, str] = field(default_factory=dict)
    versions: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Result:
    """Holds the figures of one bench and the machine on which they were measured.

    `failures` and `versions` are as in `Measured`.
    """

    bench: str
    machine: Mapping[str, str]
    figures: Mapping[str, float]
    failures: Mapping[str, str] = field(default_factory=dict)
    versions: Mapping[str, str] = field(default_factory=dict)

    def as_dict(self) -> dict[str, Any]:
        """Returns the result as plain data."""
        return {
            "bench": self.bench,
            "machine": dict(self.machine),
            "figures": dict(self.figures),
            "failures": dict(self.failures),
            "versions": dict(self.versions),
        }

    def to_json(self) -> str:
        """Returns the result as one JSON object on one line."""
        return json.dumps(self.as_dict())

    @classmethod
    def from_json(cls, text: str) -> Result:
        """Returns a result written by `to_json`. Raises `VoleryError` if the text is invalid."""
        try:
            return cls.from_dict(json.loads(text))
        except json.JSONDecodeError:
            raise VoleryError(f"not the result of a bench: {text[:80]!r}") from None

    @classmethod
    def from_dict(cls, data: Any) -> Result:
        """Returns a result from plain data. Raises `VoleryError` if the data is invalid."""
        try:
            figures = {str(k): float(v) for k, v in data["figures"].items()}
            machine = _texts(data["machine"])
            failures, versions = _texts(data.get("failures", {})), _texts(data.get("versions", {}))
            return cls(str(data["bench"]), machine, figures, failures, versions)
        except (KeyError, TypeError, ValueError, AttributeError):
            raise VoleryError("not the result of a bench: bench, machine, figures") from None


@dataclass(frozen=True)
class Bench:
    """Describes a bench: a module to measure with and the bounds of its figures.

    `in_all`: whether `volery bench --all` runs it. `apart`: prefix of figures that have a page of
    their own. `has_quick`: whether `measure` takes `quick`. `has_parts`: whether it takes `only`,
    the names of parts.
    """

    name: str
    title: str
    bounds: Mapping[str, Bound] = field(default_factory=dict)
    in_all: bool = True
    apart: str = ""
    has_quick: bool = False
    has_parts: bool = False

    def run(self, *, quick: bool = False, only: Sequence[str] = ()) -> Result:
        """Measures; `quick` less, `only` the parts. Raises `VoleryError` if there are none."""
        module = importlib.import_module(f"volery_benchmarks.{self.name}")
        if quick and not self.has_quick:
            raise VoleryError(f"bench {self.name} has no --quick")
        if only and not self.has_parts:
            raise VoleryError(f"bench {self.name} has no parts for --only")
        options: dict[str, Any] = {"quick": True} if quick else {}
        if only:
            options["only"] = tuple(only)
        found: Measured | dict[str, float] = module.measure(**options)
        measured = found if isinstance(found, Measured) else Measured(found)
        machine = {**describe_machine(), **describe_versions()}
        return Result(self.name, machine, measured.figures, measured.failures, measured.versions)


def chosen_parts(bench: str, known: Collection[str], only: Sequence[str]) -> Collection[str]:
    """Returns the parts of a bench named in `only`, by default all those known.

    Raises `VoleryError` for an unknown part.
    """
    for name in only:
        if name not in known:
            raise VoleryError(f"bench {bench} has no part '{name}': {', '.join(known)}")
    return only or known


def _texts(data: Any) -> dict[str, str]:
    return {str(k): str(v) for k, v in data.items()}


BENCHES: dict[str, Bench] = {
    bench.name: bench
    for bench in (
        Bench(
            "lidar",
            "LIDAR: ray casting in a 500 m forest of 5,000 trees, max range 30 m, "
            "batches of 100 UAVs with two scanners of 1081 beams",
            {
                "rays_per_s_1_thread": Bound(6e6),
                "rays_per_s_2_threads": Bound(11e6),
                "ratio_to_embreex_run": Bound(1.3),
                "ratio_to_open3d": Bound(1.8),
            },
            has_quick=True,
        ),
        Bench(
            "fleet",
            "Fleet: the largest at real-time factor 1, each UAV with two planar LIDARs at 40 Hz "
            "(`_64_rings`: one of 64 x 1024 beams at 10 Hz instead), IMU at 200 Hz, physics and "
            "control at 1 kHz",
            {"realtime_uavs": Bound(60.0)},
        ),
        Bench(
            "camera",
            "Cameras: 640 x 480 images in the forest of the bench `lidar`, with shadows; the "
            "largest fleet at real-time factor 1 with 320 x 240 colour and depth at 10 Hz",
            {
                "rgbd_ms_1_thread": Bound(120.0, at_most=True),
                "rgbd_ms_2_threads": Bound(65.0, at_most=True),
                "depth_ms_2_threads": Bound(35.0, at_most=True),
                "realtime_camera_uavs": Bound(4.0),
            },
        ),
        Bench(
            "dynamics",
            "Dynamics: plant and control, fused substeps; a swarm with contacts and downwash, "
            "500 Hz position control; 1,024 environments under velocity control on two threads",
            {
                "ns_per_drone_step_n1000": Bound(150.0, at_most=True),
                "us_per_step_n1": Bound(1.5, at_most=True),
                "realtime_factor_100_drones": Bound(50.0),
                "steps_per_s_1024_copies": Bound(5e6),
            },
        ),
        Bench(
            "reset",
            "Reset: restoring a snapshot, ten UAVs of the main job with two LIDARs and their node",
            {"restore_ms_10_uavs": Bound(5.0, at_most=True)},
        ),
        Bench(
            "start",
            "Start: the import of `volery`; from the command to the first frame, and memory of the "
            "main job",
            {
                "import_ms": Bound(60.0, at_most=True),
                "first_frame_s_cold": Bound(20.0, at_most=True),
                "first_frame_s_warm": Bound(3.0, at_most=True),
                "peak_mb_main_job": Bound(700.0, at_most=True),
            },
        ),
        Bench(
            "bridge",
            "Bridges: messages to clients in their own processes; the lines are "
            "L = alpha S + beta through the medians of 100 messages a size, 0 to 2.5 MB; sizes and "
            "end points beside the published ones in [bridge_latency.md](bridge_latency.md)",
            {
                "ros_tcp_alpha_s_per_mb": Bound(0.0015, at_most=True),
                "ros_tcp_beta_s": Bound(0.0004, at_most=True),
                "ros_tcp_round_trip_ms": Bound(1.2, at_most=True),
                "ros_tcp_round_trip_p99_ms": Bound(4.0, at_most=True),
                "rosbridge_round_trip_ms": Bound(2.0, at_most=True),
                "stop_wall_p95_ms": Bound(1.5, at_most=True),
                "ros1_one_way_ratio": Bound(1.3, at_most=True),
                "stream_age_p95_ms": Bound(12.0, at_most=True),
                "stream_lost": Bound(0.0, at_most=True),
                "stream_real_time_factor": Bound(0.99),
            },
            apart="latency_",
        ),
        Bench(
            "ros2",
            "ROS 2 over DDS: one way from the simulation to a subscriber in another process, the "
            "line L = alpha S + beta through images of 0 to 1 MB; scans of 10 UAVs with two LIDARs "
            "at 40 Hz to one subscriber, and while a subscriber is stopped",
            {
                "alpha_s_per_mb": Bound(0.003, at_most=True),
                "beta_s": Bound(0.0007, at_most=True),
                "stream_lost": Bound(0.0, at_most=True),
                "stream_real_time_factor": Bound(0.99),
                "stopped_real_time_factor": Bound(0.99),
            },
            in_all=False,  # it needs the extra "ros2"
        ),
        Bench(
            "coverage",
            "Coverage: areas and tours of the reference cases of DARP; beside an open "
            "implementation where there is one, see [coverage.md](coverage.md#figures)",
            {
                f"{case}_share_of_peer": Bound(0.5, at_most=True)
                for case in (
                    "10x10_3_uavs",
                    "20x20_4_uavs",
                    "50x50_4_uavs_in_a_corner",
                    "50x50_5_uavs",
                )
            },
        ),
        Bench(
            "avoidance",
            "Avoidance by depth camera: 50 fields of trees and 50 of blocks, a course of 66 m at "
            "2 m/s; `region`: mean depth of one region, `whole`: every pixel",
            {
                "trees_whole_collisions": Bound(2.0, at_most=True),
                "blocks_whole_collisions": Bound(2.0, at_most=True),
            },
            in_all=False,  # it takes a quarter of an hour
        ),
        Bench(
            "search",
            "Search: a UAV's call to another one, from the caller to the handler, and back; each "
            "node in its own process, or both in lock step",
            {
                f"{connection}_one_way_ms": Bound(10.0, at_most=True)
                for connection in ("lock_step", "rosbridge", "ros1")
            },
        ),
        Bench(
            "mavlink",
            "MAVLink: ten autopilots with the streams of an onboard computer and of a ground "
            "station, beyond the same flight without them; commands from another process; "
            "velocity setpoints to rotors in simulated time, physics at 250 Hz",
            {
                "ten_vehicles_core_share": Bound(0.25, at_most=True),
                "ack_p95_ms": Bound(20.0, at_most=True),
                "setpoint_to_motor_ms": Bound(10.0, at_most=True),
            },
        ),
        Bench(
            "comms",
            "Radio network: 64 stations in one process, the communication server in another one, "
            "5,000 messages/s of 256 bytes to changing stations over loopback; latency from send "
            "to handler, before the server is killed; lost and reordered also while that happens "
            "and another one starts; `rejoin_s` from its listening again to the last welcome",
            {
                "messages_per_s": Bound(4950.0),
                "p99_ms": Bound(15.0, at_most=True),
                "lost": Bound(0.0, at_most=True),
                "reordered": Bound(0.0, at_most=True),
                "rejoin_s": Bound(2.0, at_most=True),
            },
        ),
        Bench(
            "page",
            "Page: the page in headless Chromium that draws WebGL in software, server and "
            "browser on loopback of one machine; `hover` at 640x360 opened, 10 and 1,000 UAVs at "
            "320x180, a forest of 5,000 trees; memory over 15 minutes",
            {
                "bundle_initial_mb": Bound(1.0, at_most=True),
                "first_picture_s": Bound(4.0, at_most=True),
                "script_ms_50_uavs": Bound(5.0, at_most=True),
                "script_ms_256_uavs": Bound(12.0, at_most=True),
                "script_ms_1000_uavs": Bound(16.0, at_most=True),
                "draw_calls": Bound(250.0, at_most=True),
                "age_p95_ms": Bound(80.0, at_most=True),
                "age_p95_ms_1000_uavs": Bound(120.0, at_most=True),
                "stalled_client_rtf_loss": Bound(0.03, at_most=True),
                "stalled_client_memory_mb": Bound(20.0, at_most=True),
                "nine_clients_lost": Bound(0.0, at_most=True),
                "nine_clients_real_time_factor": Bound(0.99),
                "heap_growth_15_min": Bound(0.15, at_most=True),
            },
            in_all=False,  # it takes twenty minutes and a browser
        ),
        Bench(
            "forest_search",
            "Forest search: three UAVs without satellite navigation divide the Barro Colorado "
            "forest for five minutes, ten seeds; each with two LIDARs at 40 Hz, a camera at 5 Hz, "
            "IMU, sonar, radio; `searched_three_to_one` beside one UAV in the same time",
            {
                "realtime_factor": Bound(1.0),
                "ate_rmse_m_median": Bound(0.30, at_most=True),
                "ate_rmse_m_worst": Bound(2.0, at_most=True),
                "collisions": Bound(0.0, at_most=True),
                "distance_m_least": Bound(500.0),
                "searched_three_to_one": Bound(2.4),
                "trunks_within_half_m": Bound(0.95),
                "target_delay_s_worst": Bound(1.0, at_most=True),
            },
            in_all=False,  # it takes an hour
            has_quick=True,
        ),
        Bench(
            "load",
            "Load: CPU load of one, two, three and six UAVs of the scenario `forest_search` on one "
            "core, in percent of real time; nodes by the CPU time of their callbacks",
            has_quick=True,
        ),
        Bench(
            "hostile",
            "Hostile clients: a run in real time while clients attack its bridges, each attack in "
            "its own process on one core; real-time factor, delay of another client's service "
            "call, memory growth; the worst of all attacks, and of each",
            {
                "rtf_under_attack": Bound(0.95),
                "other_client_delay_p99_ms": Bound(50.0, at_most=True),
                "memory_growth_mb": Bound(50.0, at_most=True),
                "memory_growth_1000_viewers_mb": Bound(300.0, at_most=True),
                "rtf_120_stopped_subscribers": Bound(0.95),
            },
            in_all=False,  # nothing else can be measured beside it
            has_quick=True,
        ),
        Bench(
            "swarm",
            "Swarm: plans that lead seven birds from random starts into a V; CPU time of a plan "
            "(ARES, TACAS 2017: 95 % of 8,000 starts, 63 s); flights of seven F450s into a V, and "
            "into a new one after one or two have landed; `dampc_...`: birds without a leader, and "
            "flights by radio; `games_...`: games that the search wins against an attacker; crowds "
            "of 30 to 100 F450s by four behaviours: `..._collisions`: runs in which a UAV touches "
            "something, `..._arrived`: share of runs in which all others arrive within 150 s; 100 "
            "runs by ORCA and trajectories, 10 by others; flocks "
            "with contacts and downwash at 1 kHz, 1,000 UAVs and the largest number in real time",
            {
                "ares_success": Bound(0.97),
                "ares_s_mean": Bound(10.0, at_most=True),
                "recovery_s_one_lost": Bound(20.0, at_most=True),
                "recovery_success_one_lost": Bound(0.95),
                "swarm_1000_realtime_factor": Bound(8.0),
                "realtime_uavs_state": Bound(4000.0),
                "circle_swap_orca_collisions": Bound(0.0, at_most=True),
                "crossing_streams_orca_collisions": Bound(0.0, at_most=True),
                "forest_passage_orca_collisions": Bound(0.0, at_most=True),
            },
            in_all=False,  # it takes hours
            has_quick=True,
            has_parts=True,
        ),
        Bench(
            "verdicts",
            "Scenario tests: `hover` with five expectations again and again while two processes "
            "burn the cores, and in other processes; flights of a minute through forests by LIDAR; "
            "CPU time of `forest_survey` with ten expectations; flights until a search finds a "
            "gust that blows an avoiding UAV into a tree (`search_found`: share of 20 searches "
            "that take at most 200), beside random values; 30 submissions graded, three of them "
            "hostile",
            {
                "verdicts_that_differ": Bound(0.0, at_most=True),
                "digests_that_differ": Bound(0.0, at_most=True),
                "replays_equal": Bound(3.0),
                "avoidance_minutes": Bound(20.0, at_most=True),
                "overhead_of_ten": Bound(0.02, at_most=True),
                "search_found": Bound(1.0),
                "random_to_search": Bound(2.0),
                "grading_minutes": Bound(10.0, at_most=True),
                "graded_as_alone": Bound(27.0),
            },
            in_all=False,  # it takes hours, and needs the extra "search"
            has_quick=True,
            has_parts=True,
        ),
        Bench(
            "cluster",
            "Studies of many runs: `hover` for 5 s, 1,000 seeds; runs per second of CPU time of "
            "driver and worker, without the start of the processes; each run a simulation of its "
            "own, or together as environments; beside a bare loop over the same runs; "
            "`killed_and_resumed`: 1 if the table of a study of 2,000 runs, whose driver was "
            "killed five times, equals that of an uninterrupted one; `ray_...`: on a Ray "
            "cluster of two network namespaces with a core each; a worker is killed, the link cut; "
            "`split_...`: `forest_survey` with 40 UAVs, `obstacle_field` (depth cameras) with 8, "
            "divided between these machines",
            {
                "sweep_runs_per_s_core": Bound(20.0),
                "sweep_runs_per_s_core_vectorized": Bound(500.0),
                "sweep_overhead": Bound(0.03, at_most=True),
                "killed_and_resumed": Bound(1.0),
                "ray_efficiency": Bound(0.95),
                "ray_digests_equal": Bound(1.0),
                "loss_noticed_s": Bound(10.0, at_most=True),
                "results_lost": Bound(0.0, at_most=True),
                "split_efficiency": Bound(0.90),
                "split_digests_equal": Bound(1.0),
                "split_cameras_efficiency": Bound(0.90),
                "split_cameras_digests_equal": Bound(1.0),
            },
            in_all=False,  # it needs the extra "cluster"
            has_quick=True,
        ),
        Bench(
            "learning",
            "Learning: decisions per second of 1,024 environments (256 with depth images) on two "
            "threads, rewards, ends and automatic resets included; trainings with the shipped "
            "configurations, median of five seeds; shipped policies in 200 episodes never trained "
            "on, and in the full simulation (`transfer`: estimator, sensor noise, 20 ms latency)",
            {
                "env_steps_per_s_state": Bound(300e3),
                "env_steps_per_s_rotor": Bound(500e3),
                "env_steps_per_s_lidar": Bound(60e3),
                "env_steps_per_s_depth": Bound(5e3),
                "reset_ms_1024": Bound(5.0, at_most=True),
                "train_s_hover": Bound(30.0, at_most=True),
                "train_success_hover_least": Bound(0.99),
                "train_s_homing": Bound(10.0, at_most=True),
                "train_success_homing_least": Bound(0.98),
                "success_servoing": Bound(0.95),
                "success_forest": Bound(0.95),
            },
            in_all=False,  # it needs the extra "train"
            has_parts=True,
        ),
        Bench(
            "peers",
            "Peers: other simulators beside Volery, in turns on one core; [peers.md](peers.md) "
            "lists what each includes",
            in_all=False,  # it installs a few GB
        ),
    )
}


def find(name: str) -> Bench:
    """Returns a bench by name. Raises `VoleryError` with the known names if there is none."""
    if name not in BENCHES:
        raise VoleryError(f"no bench '{name}'; there are {', '.join(BENCHES)}, or all")
    return BENCHES[name]
