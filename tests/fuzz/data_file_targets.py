"""Data files that a scenario names: airframes, identified models, sensors, tables, species."""

from __future__ import annotations

import io
import json
from functools import cache
from pathlib import Path

import numpy as np
from flight_check import refused_or_flown, refused_or_read
from scratch_files import path_of
from toml_mutation import changed_text, toml_of, write

import volery
from volery.scenario.data_files import load_data_file
from volery.scenario.load import load_scenario
from volery.sensors.lidar.beam_file import read_beams
from volery.sensors.lidar.lidar_model import load_lidar
from volery.vehicle.airframe import load_airframe
from volery.world.inventory import read_inventory
from volery.world.terrain import Terrain
from volery.world.trees.species import Species
from volery.world.weather.wind_field_files import read_wind_field

_PACKAGE = Path(volery.__file__).parent
_KIND_OF_MODEL = {
    "adis16448": "imu",
    "iim42653": "imu",
    "barometer_px4": "barometer",
    "downward_sonar": "sonar",
    "gnss_gazebo_classic": "gnss",
    "gnss_f9p_rtk": "gnss",
    "gnss_m8": "gnss",
    "magnetometer_px4": "magnetometer",
    "visual_inertial": "odometry",
    "utm_30lx": "lidar",
    "utm_30lx_ew": "lidar",
    "vlp_16": "lidar",
    "mid_40": "lidar",
    "pinhole": "camera",
    "f450_front": "camera",
}
_BEAMS = b"azimuth_deg,elevation_deg,time_s,ring\n-10,0,0.0,0\n0,1.5,0.001,1\n10,-2,0.002,2\n"
_BEAMS_OF_NUMPY = b"# azimuth_deg elevation_deg time_s\n-1e1 0 0.0\n0 1.5 0.001\n# end\n"
_TREES = (
    b"x_m,y_m,dbh_cm,height_m,species\n8,3,25,12,broadleaf\n12,-4,30,,conifer\n15,6,,9,\n",
    b"y_m,x_m\n9,9\n10,14\n",
    b"sep=;\r\nid;X (m);Y (m);dbh_mm\r\n1;8,5;9;#NV\r\n2;9;10,5;300\r\n",
    b'"x_m" "y_m" "species"\n"1" 8 9 "red oak"\n"2" 9 10 NA\n',
)
_HEIGHTS = (b"0,0,1\n0,1,2\n1,2,3\n", b"-1.5,2e0\n3,4\n", b'# m\n"1,5";"2"\n3;4;\n')
_WIND = (
    b"x_m,y_m,z_m,vx_m_s,vy_m_s,vz_m_s\n"
    b"-100,-100,0,1,0,0\n100,-100,0,2,0,0\n-100,100,0,1,1,0\n100,100,0,2,1,0\n"
    b"-100,-100,50,3,0,0\n100,-100,50,4,0,0\n-100,100,50,3,1,0\n100,100,50,4,1,.5\n"
)
_WIND_OF_EXCEL = _WIND.replace(b",", b";").replace(b".", b",").replace(b"\n", b";\r\n")


def airframes(mutator):
    """Airframes, flown as rigid bodies, identified and kinematic."""
    text = mutator.pick(_texts("vehicle/airframes"))
    write(path_of("airframe.toml"), changed_text(mutator, text))
    kind = {
        "airframe": "airframe.toml",
        "plant": mutator.pick(("rigid_body",) * 4 + ("kinematic",)),
    }
    return _flown(kind)


def identified_models(mutator):
    """Identified models, flown."""
    text = mutator.pick(_texts("vehicle/identified"))
    write(path_of("identified.toml"), changed_text(mutator, text))
    return _flown({"plant": "identified", "identified_model": "identified.toml"})


def sensor_models(mutator):
    """Sensor models of every kind, one of them on a UAV."""
    name = mutator.pick(tuple(_KIND_OF_MODEL))
    text = (_PACKAGE / "sensors/models" / f"{name}.toml").read_text(encoding="utf-8")
    write(path_of("model.toml"), changed_text(mutator, text))
    sensor = {"kind": _KIND_OF_MODEL[name], "model": "model.toml"}
    if sensor["kind"] == "camera":
        sensor |= {"width": 40, "height": 30}
    return _flown({"sensors": [sensor, *_estimated(sensor["kind"])]})


def based_files(mutator):
    """Chains and circles of files that change each other, one of them a scanner or an airframe."""
    load, folder = mutator.pick(
        ((load_lidar, "sensors/models"), (load_airframe, "vehicle/airframes"))
    )
    names = ("one.toml", "two.toml", "three.toml")
    for name in names:
        base = mutator.pick((*names, *names, "vlp_16", "f450", "utm_30lx", "../x.toml", "", "x\0y"))
        lines = changed_text(mutator, mutator.pick(_texts(folder))).splitlines()
        part = lines[: mutator.pick((0, 3, 12, len(lines)))]
        write(path_of(name), "\n".join([f"base = {json.dumps(base)}", *part, ""]))
    refused_or_read(lambda: load(path_of(names[0])))
    return 1


def _estimated(kind):
    """An estimator that listens to a sensor of navigation, and what it needs besides."""
    if kind not in ("imu", "gnss", "barometer", "magnetometer"):
        return []
    others = ("imu", "gnss", "barometer", "magnetometer")
    return [*({"kind": other} for other in others if other != kind), {"kind": "estimate"}]


def beam_tables(mutator):
    """Beam patterns in tables, read alone and by a scanner in flight."""
    path = path_of("beams.csv")
    path.write_bytes(mutator.bytes([_BEAMS, _BEAMS_OF_NUMPY]))
    beams = refused_or_read(lambda: read_beams(path, 0.1, 1000))
    if beams is not None:
        assert np.isfinite(beams.direction).all()
    if mutator.chance(0.9):
        return 1
    text = (_PACKAGE / "sensors/models/utm_30lx.toml").read_text(encoding="utf-8")
    head, _, tail = text.partition("[scan]")
    rest = tail[tail.index("\n[") :]
    table = '[scan]\nkind = "table"\nrate_hz = 10.0\nfile = "beams.csv"\n'
    write(path_of("model.toml"), head + table + rest)
    return 1 + _flown({"sensors": [{"kind": "lidar", "model": "model.toml"}]})


def wind_tables(mutator):
    """Wind fields, read alone and flown in."""
    name = mutator.pick(("wind.csv", "wind.npz"))
    path = path_of(name)
    path.write_bytes(
        mutator.bytes([_WIND, _WIND_OF_EXCEL] if name == "wind.csv" else [_wind_archive()])
    )
    field = refused_or_read(lambda: read_wind_field(path))
    if field is not None:
        assert np.isfinite(field[0]).all()
    if mutator.chance(0.9):
        return 1
    return 1 + _flown({}, {"wind": {"field": name}})


def tree_tables(mutator):
    """Inventories of trees, read alone and flown over."""
    path = path_of("trees.csv")
    path.write_bytes(mutator.bytes(list(_TREES)))
    trees = refused_or_read(lambda: read_inventory(path))
    if trees is None or mutator.chance(0.95):
        return 1
    forest = {"kind": "inventory", "file": "trees.csv", "species": "broadleaf"}
    return 1 + _flown({}, {"forest": forest})


def height_tables(mutator):
    """Elevation grids, read alone and flown over."""
    path = path_of("heights.csv")
    path.write_bytes(mutator.bytes(list(_HEIGHTS)))
    spacing = mutator.pick((0.5, 10.0))
    terrain = refused_or_read(lambda: Terrain.from_csv(path, spacing))
    if terrain is None or mutator.chance(0.9):
        return 1
    return 1 + _flown(
        {}, {"terrain": {"kind": "grid", "file": "heights.csv", "spacing_m": spacing}}
    )


def species_files(mutator):
    """Species of trees: their laws of height, crown and diameter."""
    path = path_of("species.toml")
    write(path, changed_text(mutator, mutator.pick(_texts("world/trees/species"))))
    species = refused_or_read(lambda: load_data_file(path, Species))
    if species is not None:
        diameters = species.spread().draw(np.random.default_rng(1), 5)
        heights = species.heights(diameters, np.random.default_rng(1))
        radii = [species.crown_width.radius(d) for d in diameters.tolist()]
        assert np.isfinite(diameters).all(), diameters
        assert np.isfinite(heights).all(), heights
        assert np.isfinite(radii).all(), radii
    return 1


def _flown(kind, world=None):
    sensors = [{"kind": "imu"}, {"kind": "ground_truth"}]
    data = {
        "name": "hover",
        "duration_s": 5.0,
        "world": world or {},
        "types": {"it": {"sensors": sensors, **kind}},
        "uavs": [{"type": "it", "position_m": [0.0, 0.0], "on_start": "take_off"}],
    }
    if kind.get("plant") in ("identified", "kinematic"):
        data["uavs"] = [{"type": "it", "position_m": [0.0, 0.0, 20.0]}]
    path = path_of("scenario.toml")
    write(path, toml_of(data))
    refused_or_flown(lambda: load_scenario(path))
    return 1


@cache
def _texts(folder):
    return [p.read_text(encoding="utf-8") for p in sorted((_PACKAGE / folder).glob("*.toml"))]


@cache
def _wind_archive():
    buffer = io.BytesIO()
    np.savez(
        buffer,
        velocity_m_s=np.ones((2, 2, 2, 3)),
        origin_m=np.array([-100.0, -100.0, 0.0]),
        spacing_m=np.array([200.0, 200.0, 50.0]),
    )
    return buffer.getvalue()
