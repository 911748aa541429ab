"""Stepping, pacing, ending, and what the graph carries."""

import time

import numpy as np
import pytest

import volery
from volery.core.errors import CommandError, ScenarioError
from volery.graph.messages import typestore


def collect(simulation, seconds):
    got = {}
    simulation.graph.subscribe_all(lambda m: got.setdefault(m.topic, []).append(m))
    simulation.run(seconds)
    return got


def test_topics_rates_and_stamps(simulate, wood_data):
    wood_data["types"]["surveyor"]["nodes"] = []
    got = collect(simulate(wood_data), 1.0)
    counts = {topic: len(messages) for topic, messages in got.items()}
    assert counts["/uav1/laser/horizontal/scan"] == 40
    assert counts["/uav2/laser/nodding/scan"] == 40
    assert counts["/uav1/imu"] == 201
    assert counts["/uav1/range"] == 11
    assert counts["/uav1/odom"] == counts["/uav1/ground_truth/odom"] == 51
    assert counts["/uav1/joint_states"] == 81
    assert counts["/clock"] == 100
    assert counts["/tf_static"] == 1
    scan = got["/uav1/laser/horizontal/scan"][1]
    assert scan.message.header.stamp.nanosec == 25_000_000  # first beam
    assert scan.time_ns == 44_000_000  # the sweep of 18.75 ms has ended
    assert scan.message.header.frame_id == "uav1/laser_horizontal"
    assert not scan.message.ranges.flags.writeable
    for messages in got.values():
        store = typestore()
        again = store.deserialize_cdr(messages[-1].cdr, messages[-1].msgtype)
        assert bytes(store.serialize_cdr(again, messages[-1].msgtype)) == messages[-1].cdr


def test_transforms_form_one_tree(simulate, wood_data):
    wood_data["types"]["surveyor"]["nodes"] = []
    got = collect(simulate(wood_data), 0.2)
    parent = {}
    for message in got["/tf"] + got["/tf_static"]:
        for transform in message.message.transforms:
            parent.setdefault(transform.child_frame_id, set()).add(transform.header.frame_id)
    assert all(len(parents) == 1 for parents in parent.values()), parent

    def root(frame):
        return root(next(iter(parent[frame]))) if frame in parent else frame

    for frame in ("uav1/laser_nodding", "uav2/laser_horizontal", "uav1/imu", "uav1/range"):
        assert root(frame) == "map"


def test_real_time_and_faster(simulate, flat_data):
    simulation = simulate(flat_data)
    simulation.run(0.1)
    start = time.perf_counter()
    simulation.run(0.5, speed=1.0)
    assert time.perf_counter() - start == pytest.approx(0.5, abs=0.2)
    told = []
    simulation.run(0.5, speed=2.0, on_progress=told.append)
    assert told[-1].time_s == pytest.approx(0.5)
    assert told[-1].real_time_factor == pytest.approx(2.0, rel=0.4)


def test_single_steps(simulate, flat_data):
    simulation = simulate(flat_data)
    simulation.step()
    assert simulation.time_ns == 1_000_000
    simulation.step(9)
    assert simulation.time_ns == 10_000_000
    simulation.step(0)
    assert simulation.time_ns == 10_000_000


def test_bad_requests(simulate, flat_data):
    simulation = simulate(flat_data)
    for seconds in (-1.0, float("nan"), float("inf")):
        with pytest.raises(CommandError, match="finite"):
            simulation.run(seconds)
    with pytest.raises(CommandError, match="speed"):
        simulation.run(1.0, speed=0.0)
    with pytest.raises(CommandError, match="negative"):
        simulation.step(-1)
    with pytest.raises(ScenarioError, match="threads"):
        simulate(flat_data, threads=0)
    with pytest.raises(CommandError):
        simulation.uavs["uav1"].go_to([np.nan, 0, 0])


def test_a_run_ends_at_its_duration(simulate, flat_data):
    flat_data["duration_s"] = 0.35
    simulation = simulate(flat_data)
    assert not simulation.finished
    simulation.run()
    assert simulation.time_s == pytest.approx(0.35)
    assert simulation.finished


def test_the_package_names_its_entrances():
    assert volery.__version__
    assert volery.load_scenario("hover").name == "hover"
    assert {"Scenario", "Simulation", "load_scenario"} <= set(volery.__all__)
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        _ = volery.nothing
