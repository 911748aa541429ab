"""`/tf` locates UAVs without odometry: the true pose, until others publish the frame."""

import pytest

from volery.graph.messages import TFMessage, Transform, TransformStamped, Vector3, header

FLAT_LIDAR = {"kind": "lidar", "name": "flat", "model": "utm_30lx"}


def with_sensors(data, *sensors):
    data["types"]["f450"]["sensors"] = list(sensors)
    return data


def transforms_of(simulation):
    """Returns a list that receives the transforms on `/tf`."""
    received = []
    simulation.graph.subscribe("/tf", lambda p: received.extend(p.message.transforms), TFMessage)
    return received


def test_a_uav_without_odometry_is_located_by_its_true_pose(simulate, flat_data):
    flat_data["uavs"][0]["position_m"] = [0.0, 0.0, 2.0]
    simulation = simulate(with_sensors(flat_data, FLAT_LIDAR))
    received = transforms_of(simulation)
    simulation.uavs["uav1"].go_to((3.0, 1.0, 2.0))
    simulation.run(4.0)
    last = received[-1]
    assert (last.header.frame_id, last.child_frame_id) == ("map", "uav1/base_link")
    stamp = last.header.stamp
    assert stamp.sec * 1_000_000_000 + stamp.nanosec == simulation.time_ns
    shift = last.transform.translation
    assert [shift.x, shift.y, shift.z] == simulation.uavs["uav1"].position_map.tolist()
    assert shift.x > 0.5
    assert len(received) == 200


@pytest.mark.parametrize("sensors", [[{"kind": "odometry"}], []])
def test_odometry_locates_its_uav_itself_and_bare_uavs_have_no_frame(simulate, flat_data, sensors):
    simulation = simulate(with_sensors(flat_data, *sensors))
    received = transforms_of(simulation)
    simulation.run(0.5)
    parents = {t.header.frame_id for t in received}
    assert parents == ({"uav1/odom"} if sensors else set())


@pytest.mark.parametrize("frame", ["base_link", "odom"])
def test_a_localization_of_the_users_own_takes_over(simulate, flat_data, frame):
    flat_data["uavs"][0]["count"] = 2
    simulation = simulate(with_sensors(flat_data, FLAT_LIDAR))
    received = transforms_of(simulation)
    publisher = simulation.graph.advertise("/tf", TFMessage)

    def localize():
        pose = Transform(Vector3(9.0, 0.0, 0.0))
        publisher.publish(TFMessage([TransformStamped(header(0, "map"), f"uav2/{frame}", pose)]))

    simulation.run(0.1)
    before = simulation.snapshot()
    localize()
    simulation.run(0.04)
    received.clear()
    simulation.run(0.1)
    assert {t.child_frame_id for t in received} == {"uav1/base_link"}
    simulation.restore(before)
    received.clear()
    simulation.run(0.1)
    assert {t.child_frame_id for t in received} == {"uav1/base_link", "uav2/base_link"}


def test_other_frames_of_a_uav_change_nothing(simulate, flat_data):
    simulation = simulate(with_sensors(flat_data, FLAT_LIDAR))
    received = transforms_of(simulation)
    publisher = simulation.graph.advertise("/tf", TFMessage)
    tag = TransformStamped(header(0, "uav1/base_link"), "uav1/tag_3", Transform())
    publisher.publish(TFMessage([tag]))
    simulation.run(0.1)
    received.clear()
    simulation.run(0.1)
    assert {t.child_frame_id for t in received} == {"uav1/base_link"}


def test_without_receivers_nothing_is_built(simulate, flat_data, monkeypatch):
    from volery.runtime.vehicles import pose_transforms

    built = []
    build = pose_transforms.transforms_in_map
    monkeypatch.setattr(
        pose_transforms, "transforms_in_map", lambda *a: built.append(1) or build(*a)
    )
    simulation = simulate(with_sensors(flat_data, FLAT_LIDAR))
    simulation.run(0.2)
    assert not built
    transforms_of(simulation)
    simulation.run(0.2)
    assert len(built) == 10


def test_a_spawned_and_deleted_uav(simulate, flat_data):
    simulation = simulate(with_sensors(flat_data, FLAT_LIDAR))
    received = transforms_of(simulation)
    simulation.vehicles.spawn("late", "f450", (5.0, 5.0, 0.0))
    simulation.run(0.1)
    assert "late/base_link" in {t.child_frame_id for t in received}
    simulation.vehicles.delete("late")
    simulation.run(0.02)
    received.clear()
    simulation.run(0.1)
    assert {t.child_frame_id for t in received} == {"uav1/base_link"}


def test_the_last_uav_without_odometry_takes_its_subscription_with_it(simulate, flat_data):
    flat_data["types"]["probe"] = {"airframe": "f450", "sensors": [FLAT_LIDAR]}
    simulation = simulate(flat_data)
    before = simulation.graph.subscribers("/tf")
    simulation.vehicles.spawn("late", "probe", (5.0, 5.0, 0.0))
    assert simulation.graph.subscribers("/tf") == before + 1
    simulation.vehicles.delete("late")
    assert simulation.graph.subscribers("/tf") == before
