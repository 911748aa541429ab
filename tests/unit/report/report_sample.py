"""A made-up flight over the Barro Colorado terrain, for tests and for looking at the page."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from volery.figures.flight_data import FlightData, FlightEvent, Ground, LidarMap, Trees, UavTrack

FORESTS = Path(__file__).parents[3] / "src/volery/world/data/forests"


def sample_flight(uavs: int = 3, seconds: float = 180.0, *, contacts: int = 1) -> FlightData:
    rng = np.random.default_rng(3)
    heights = np.loadtxt(FORESTS / "bei_elevation.csv", delimiter=",")[:, :101]
    xy = np.loadtxt(FORESTS / "bei_trees.csv", delimiter=",", skiprows=1)
    xy = xy[xy[:, 0] < 500.0]

    def ground(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        i = np.clip((y / 5).astype(int), 0, 100)
        j = np.clip((x / 5).astype(int), 0, 100)
        return heights[i, j]

    foot = np.column_stack([xy, ground(xy[:, 0], xy[:, 1])])
    dbh = rng.lognormal(np.log(0.18), 0.6, len(foot))
    crown = 1.2 + 9.0 * dbh
    tracks = []
    for k in range(uavs):
        t = np.arange(0.0, seconds, 0.05)
        x = 60.0 + 1.9 * t + 6 * np.sin(t / 9.0 + k)
        y = 120.0 + 90.0 * k * 3 / uavs + 14.0 * np.sin(t / 17.0 + 2 * k) + 5 * np.sin(t / 4.0 + k)
        agl = 6.0 * np.clip(t / 4.0, 0, 1) + 0.3 * np.sin(t / 3.0 + k)
        p = np.column_stack([x, y, ground(x, y) + agl])
        speed = np.append(np.linalg.norm(np.diff(p[:, :2], axis=0), axis=1) / 0.05, 1.9)
        gap = np.abs(foot[None, :, :2] - p[::20, None, :2])
        clear = np.maximum(np.hypot(gap[..., 0], gap[..., 1]).min(axis=1) - 0.3, 0.2)
        clear = np.interp(t, t[::20], clear)
        clear[clear > 10.0] = np.inf
        tracks.append(UavTrack(f"uav{k + 1}", t, p, speed, agl, clear))
    points = []
    for p in (t.position_map[::30] for t in tracks):
        for q in p:
            near = np.hypot(*(foot[:, :2] - q[:2]).T) < 22.0
            for f, d, c in zip(foot[near], dbh[near], crown[near], strict=True):
                a = rng.uniform(0, 2 * np.pi, 40)
                z = rng.uniform(0.0, 14.0, 40)
                r = np.where(z > 5.0, c * np.sqrt(rng.random(40)), d / 2)
                points.append(f + np.column_stack([r * np.cos(a), r * np.sin(a), z]))
            g = q[:2] + rng.normal(0, 8.0, (60, 2))
            points.append(np.column_stack([g, ground(g[:, 0], g[:, 1])]))
    cloud = np.unique(np.round(np.concatenate(points) / 0.25), axis=0) * 0.25
    lidar = LidarMap(
        cloud.astype(np.float32),
        (cloud[:, 2] - ground(cloud[:, 0], cloud[:, 1])).astype(np.float32),
        0.25,
        7200,
    )
    position = tuple(float(v) for v in tracks[0].position_map[-1])
    events = [
        FlightEvent(0.0, "mode", "0.000 s  uav1 take off at (60.0, 120.0, 121.0) m"),
        *[
            FlightEvent(
                seconds,
                "collision",
                f"{seconds:.3f} s  uav1 hit tree 812 at 2.10 m/s",
                (position[0], position[1], position[2]),
            )
            for _ in range(contacts)
        ],
    ]
    return FlightData(
        scenario="forest_survey",
        description="Three F450s survey the western half of the Barro Colorado forest plot and "
        "avoid its trees by what their LIDARs see.",
        seed=1,
        simulated_s=seconds,
        planned_s=seconds,
        wall_s=21.7,
        uavs=tuple(tracks),
        ground=Ground(heights, (0.0, 0.0), 5.0),
        trees=Trees(foot, crown, dbh),
        lidar=lidar,
        events=tuple(events),
        stage_seconds={
            "commands": 0.3,
            "dynamics": 3.6,
            "contacts": 1.2,
            "lidars": 9.4,
            "imu": 0.6,
            "sonar": 0.2,
            "publish": 3.1,
            "nodes": 2.4,
        },
        digest="8c1f" * 16,
        log_path=Path("out/forest_survey.mcap"),
        log_messages=251_482,
        machine={"processor": "Example CPU @ 2.5 GHz", "cores": "2", "memory": "7.8 GB"},
        versions={"volery": "0.1.0", "Python": "3.11.2", "numba": "0.61.0", "numpy": "2.1.0"},
    )
