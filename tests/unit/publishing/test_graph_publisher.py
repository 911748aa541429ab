"""Tests that nodes receive what is sent on the wire: no wire format changes a message."""

from __future__ import annotations

import dataclasses

import numpy as np

from volery.graph.codecs.cdr import decode_cdr

MORE = [
    {"kind": "battery"},
    {"kind": "gnss"},
    {"kind": "barometer"},
    {"kind": "magnetometer"},
    {"kind": "lidar", "name": "echoes", "model": "utm_30lx_ew"},
]


def differences(left, right, where=""):
    """Paths of fields whose values differ; nan equals nan."""
    if dataclasses.is_dataclass(left):
        for field in dataclasses.fields(left):
            names = f"{where}.{field.name}"
            yield from differences(getattr(left, field.name), getattr(right, field.name), names)
    elif isinstance(left, list):
        assert len(left) == len(right)
        for k, pair in enumerate(zip(left, right, strict=True)):
            yield from differences(*pair, f"{where}[{k}]")
    elif isinstance(left, float | np.ndarray):
        if not np.array_equal(left, right, equal_nan=True):
            yield where
    elif left != right:
        yield where


def test_every_message_of_a_run_comes_back_from_its_bytes_as_it_was(simulate, wood_data):
    wood_data["types"]["surveyor"]["sensors"] += MORE
    simulation = simulate(wood_data)
    changed, types = set(), set()

    def look(published):
        types.add(published.msgtype.rpartition("/")[2])
        back = decode_cdr(published.cdr, published.msgtype)
        for where in differences(published.message, back):
            changed.add(f"{published.topic} {where}")

    simulation.graph.subscribe_all(look)
    simulation.run(2.0)
    assert not changed
    assert types >= {"LaserScan", "MultiEchoLaserScan", "Range", "BatteryState", "Imu", "Odometry"}
