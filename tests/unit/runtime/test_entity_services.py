"""Entities by the standard: which exist, their poses, and moving them."""

import numpy as np
import pytest
from service_calls import call_service, code_of

OK, UNSUPPORTED, NOT_FOUND, FAILED, INVALID_POSE = 1, 0, 2, 4, 101
NAME_NOT_UNIQUE, NAME_INVALID, UNSUPPORTED_FORMAT, NO_RESOURCE = 101, 102, 103, 104
NAMESPACE_INVALID, SPAWN_POSE_INVALID, SPAWN_FAILED = 105, 109, 150
UPRIGHT = {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}


@pytest.fixture
def trio(simulate, flat_data):
    """uav1 and uav2 stand at x = 0 and 20 m, uav3 hovers at 40 m; two types."""
    flat_data["types"]["scout"] = {"airframe": "f450"}
    flat_data["uavs"] = [
        {"type": "f450", "count": 2, "position_m": [0.0, 0.0], "last_position_m": [20.0, 0.0]},
        {"type": "scout", "position_m": [40.0, 0.0, 5.0]},
    ]
    return simulate(flat_data)


def names(simulation, **filters):
    response = call_service(simulation, "/get_entities", filters=filters)
    assert code_of(response) == OK, response.result.error_message
    return list(response.entities)


def put(simulation, name, position, **changes):
    state = {"pose": {"position": dict(zip("xyz", position, strict=True)), "orientation": UPRIGHT}}
    fields = {"set_pose": True, **changes}
    return call_service(simulation, "/set_entity_state", entity=name, state=state, **fields)


def test_all_are_listed_in_order(trio):
    assert names(trio) == ["uav1", "uav2", "uav3"]


@pytest.mark.parametrize(
    ("pattern", "found"),
    [
        ("^uav[13]$", ["uav1", "uav3"]),
        ("[[:digit:]]", ["uav1", "uav2", "uav3"]),
        ("(v2|v3)", ["uav2", "uav3"]),
        ("tree", []),
    ],
)
def test_names_are_filtered_by_expressions(trio, pattern, found):
    assert names(trio, filter=pattern) == found


def test_tags_and_categories(trio):
    assert names(trio, tags={"tags": ["scout", "other"]}) == ["uav3"]
    assert names(trio, tags={"tags": ["scout", "other"], "filter_mode": 1}) == []
    assert names(trio, tags={"tags": ["uav", "f450"], "filter_mode": 1}) == ["uav1", "uav2", "uav3"]
    assert names(trio, categories=[{"category": 1}]) == ["uav1", "uav2", "uav3"]
    assert names(trio, categories=[{"category": 2}, {"category": 5}]) == []


def test_bounds_choose_what_reaches_into_them(trio):
    box = [{"x": 30.0, "y": 1.0, "z": 1.0}, {"x": 10.0, "y": -1.0, "z": -1.0}]
    assert names(trio, bounds={"type": 1, "points": box}) == ["uav2"]
    ball = [{"x": 40.0, "y": 0.0, "z": 0.0}, {"x": 5.0, "y": 0.0, "z": 0.0}]
    assert names(trio, bounds={"type": 3, "points": ball}) == ["uav3"]


@pytest.mark.parametrize(
    ("filters", "code"),
    [
        ({"filter": "((("}, FAILED),
        ({"filter": "a" * 300}, FAILED),
        ({"bounds": {"type": 2}}, UNSUPPORTED),
        ({"bounds": {"type": 9}}, FAILED),
        ({"bounds": {"type": 1, "points": [{"x": 1.0}]}}, FAILED),
        ({"bounds": {"type": 3, "points": [{"x": 1.0}, {"x": -1.0}]}}, FAILED),
        ({"bounds": {"type": 3, "points": [{"x": float("nan")}, {"x": 1.0}]}}, FAILED),
        ({"tags": {"tags": ["uav"], "filter_mode": 7}}, FAILED),
    ],
)
def test_bad_filters_are_refused_with_a_reason(trio, filters, code):
    for service in ("/get_entities", "/get_entities_states"):
        response = call_service(trio, service, filters=filters)
        assert code_of(response) == code
        assert response.result.error_message


def test_states_are_true_ones_in_the_map(trio):
    trio.run(0.2)
    response = call_service(trio, "/get_entity_state", entity="uav3")
    position = response.state.pose.position
    assert [position.x, position.y, position.z] == trio.uavs["uav3"].position_map.tolist()
    assert response.state.header.frame_id == "map"
    assert response.state.header.stamp.nanosec == 200_000_000
    every = call_service(trio, "/get_entities_states", filters={"filter": "uav[23]"})
    assert list(every.entities) == ["uav2", "uav3"]
    assert every.states[1].pose.position.x == position.x


def test_info_and_bounds(trio):
    info = call_service(trio, "/get_entity_info", entity="uav3").info
    assert info.category.category == 1
    assert "scout" in info.tags
    bounds = call_service(trio, "/get_entity_bounds", entity="uav3").bounds
    assert bounds.type == 1
    upper, lower = bounds.points
    assert upper.x > 0.1 > -0.1 > lower.x
    assert upper.z > lower.z


@pytest.mark.parametrize("service", ["state", "info", "bounds"])
def test_unknown_entities(trio, service):
    response = call_service(trio, f"/get_entity_{service}", entity="nobody")
    assert code_of(response) == NOT_FOUND
    assert "nobody" in response.result.error_message


def test_a_uav_that_stands_is_put_into_the_air_and_hovers(trio):
    assert code_of(put(trio, "uav1", (0.0, 10.0, 3.0))) == OK
    trio.run(3.0)
    uav = trio.uavs["uav1"]
    assert np.linalg.norm(uav.position_map - [0.0, 10.0, 3.0]) < 0.3
    assert uav.mode.name == "HOLD"
    uav.land()
    trio.run(10.0)
    assert uav.mode.name == "LANDED"
    assert code_of(put(trio, "uav1", (5.0, 10.0, uav.position_map[2]))) == OK
    trio.run(0.5)
    assert uav.mode.name == "LANDED"
    assert not trio.diagnostics.events[-1].kind.name.startswith("COLL")


def test_a_uav_that_flies_holds_where_it_was_put(trio):
    trio.uavs["uav3"].command_velocity([3.0, 0.0, 0.0])
    trio.run(0.4)
    assert code_of(put(trio, "uav3", (-30.0, -30.0, 8.0))) == OK
    trio.run(5.0)
    uav = trio.uavs["uav3"]
    assert np.linalg.norm(uav.position_map - [-30.0, -30.0, 8.0]) < 3.0  # it had to brake
    assert np.linalg.norm(uav.velocity_map) < 0.1


def test_twist_alone_and_both(trio):
    fields = {"state": {"twist": {"linear": {"x": 2.0}}}, "set_twist": True}
    assert code_of(call_service(trio, "/set_entity_state", entity="uav3", **fields)) == OK
    np.testing.assert_allclose(trio.uavs["uav3"].velocity_map, [2.0, 0.0, 0.0])
    trio.run(4.0)
    assert trio.uavs["uav3"].position_map[0] > 40.2
    assert np.linalg.norm(trio.uavs["uav3"].velocity_map) < 0.1


@pytest.mark.parametrize(
    ("position", "reason"),
    [
        ((20.0, 0.2, 0.3), "uav2"),
        ((0.0, 10.0, -1.0), "under the ground"),
        ((9999.0, 0.0, 10.0), "beyond the terrain"),
        ((float("nan"), 0.0, 10.0), "finite"),
    ],
)
def test_invalid_positions(trio, position, reason):
    before = trio.uavs["uav1"].position_map
    response = put(trio, "uav1", position)
    assert code_of(response) == INVALID_POSE
    assert reason in response.result.error_message
    np.testing.assert_array_equal(trio.uavs["uav1"].position_map, before)


def test_no_position_inside_a_tree(simulate, wood_data):
    simulation = simulate(wood_data)
    x, y, _z = simulation.world.forest.position_map[7]
    height = float(simulation.world.terrain.height(x, y)) + 0.5
    response = put(simulation, "uav1", (float(x), float(y), height))
    assert code_of(response) == INVALID_POSE
    assert "tree" in response.result.error_message


def test_states_that_cannot_be_set(trio):
    assert code_of(put(trio, "nobody", (0.0, 0.0, 5.0))) == NOT_FOUND
    assert code_of(put(trio, "uav3", (0.0, 0.0, 5.0), set_pose=False)) == FAILED
    assert code_of(put(trio, "uav3", (0.0, 0.0, 5.0), set_acceleration=True)) == UNSUPPORTED
    fields = {"state": {"header": {"frame_id": "odom"}}, "set_pose": True}
    assert code_of(call_service(trio, "/set_entity_state", entity="uav3", **fields)) == FAILED
    fields = {"state": {"twist": {"linear": {"x": float("inf")}}}, "set_twist": True}
    assert code_of(call_service(trio, "/set_entity_state", entity="uav3", **fields)) == FAILED
    crooked = {"pose": {"position": {"x": 0.0, "y": 9.0, "z": 5.0}, "orientation": {"w": 0.0}}}
    response = call_service(trio, "/set_entity_state", entity="uav3", state=crooked, set_pose=True)
    assert code_of(response) == INVALID_POSE


def test_a_set_state_is_the_same_again(simulate, flat_data):
    def digest():
        simulation = simulate(flat_data)
        simulation.diagnostics.enable_digest()
        simulation.run(0.1)
        put(simulation, "uav1", (0.0, 10.0, 3.0))
        simulation.run(1.0)
        return simulation.diagnostics.digest()

    assert digest() == digest()


def spawn(simulation, uri="scout", position=(60.0, 0.0, 0.0), **fields):
    pose = {"pose": {"position": dict(zip("xyz", position, strict=True))}}
    return call_service(
        simulation,
        "/spawn_entity",
        **{"entity_resource": {"uri": uri}, "initial_pose": pose, **fields},
    )


def test_types_and_airframes_can_be_spawned(trio):
    uris = [s.entity_resource.uri for s in call_service(trio, "/get_spawnables").spawnables]
    assert uris[:2] == ["f450", "scout"]
    assert "crazyflie" in uris
    assert len(set(uris)) == len(uris)
    for number, uri in enumerate(uris):
        response = spawn(trio, uri, (-10.0 * (number + 1), 0.0, 0.0), name=f"new{number}")
        assert code_of(response) == OK, response.result.error_message
        assert response.entity_name == f"new{number}"
    assert names(trio)[3:] == [f"new{number}" for number in range(len(uris))]
    info = call_service(trio, "/get_entity_info", entity="new2").info
    assert uris[2] in info.description
    assert call_service(trio, "/new0/take_off_to", altitude=2.0).success
    trio.run(3.0)
    assert trio.uavs["new0"].position_map[2] > 1.5


def test_names_are_found_where_that_is_allowed(trio):
    assert spawn(trio, name="uav2", allow_renaming=True).entity_name == "uav2_1"
    there = (80.0, 0.0, 0.0)
    assert spawn(trio, position=there, allow_renaming=True).entity_name == "uav4"
    assert code_of(spawn(trio, name="uav2")) == NAME_NOT_UNIQUE
    assert code_of(spawn(trio)) == NAME_INVALID
    assert code_of(spawn(trio, name="No")) == NAME_INVALID


@pytest.mark.parametrize(
    ("fields", "code"),
    [
        ({"entity_resource": {"resource_string": "<sdf/>"}}, UNSUPPORTED_FORMAT),
        ({"uri": ""}, NO_RESOURCE),
        ({"uri": "zeppelin"}, NOT_FOUND),
        ({"entity_namespace": "/elsewhere"}, NAMESPACE_INVALID),
        ({"position": (0.0, 0.0, 0.2)}, SPAWN_POSE_INVALID),
        ({"position": (60.0, 0.0, -5.0)}, SPAWN_POSE_INVALID),
        ({"position": (60.0, 0.0, float("nan"))}, SPAWN_POSE_INVALID),
        ({"initial_pose": {"header": {"frame_id": "odom"}}}, SPAWN_POSE_INVALID),
    ],
)
def test_what_cannot_be_spawned_is_reported(trio, fields, code):
    response = spawn(trio, name="extra", **fields)
    assert code_of(response) == code
    assert response.result.error_message
    assert names(trio) == ["uav1", "uav2", "uav3"]
    assert spawn(trio, name="extra", entity_namespace="/extra").entity_name == "extra"


def test_several_are_spawned_one_by_one(trio):
    requests = [
        {
            "name": name,
            "entity_resource": {"uri": "f450"},
            "initial_pose": {"pose": {"position": {"x": x, "y": 0.0, "z": 0.0}}},
        }
        for name, x in (("a", 60.0), ("b", 0.0), ("c", 70.0))
    ]
    response = call_service(trio, "/spawn_entities", spawn_requests=requests)
    assert code_of(response) == SPAWN_FAILED
    assert "1 of 3" in response.result.error_message
    assert [one.result.result for one in response.results] == [OK, SPAWN_POSE_INVALID, OK]
    assert [one.entity_name for one in response.results] == ["a", "", "c"]
    assert code_of(call_service(trio, "/spawn_entities", spawn_requests=[])) == OK


def test_deleting(trio):
    assert code_of(call_service(trio, "/delete_entity", entity="nobody")) == NOT_FOUND
    assert code_of(call_service(trio, "/delete_entity", entity="uav1")) == OK
    assert names(trio) == ["uav2", "uav3"]
    assert code_of(call_service(trio, "/delete_entity", entity="uav3")) == OK
    response = call_service(trio, "/delete_entity", entity="uav2")
    assert code_of(response) == FAILED
    assert "at least one" in response.result.error_message


def test_starts_are_named_poses(trio):
    poses = call_service(trio, "/get_named_poses").poses
    assert [pose.name for pose in poses] == ["uav1_start", "uav2_start", "uav3_start"]
    assert poses[2].pose.position.z == 5.0
    chosen = call_service(trio, "/get_named_poses", tags={"tags": ["scout"]}).poses
    assert [pose.name for pose in chosen] == ["uav3_start"]
    bounds = call_service(trio, "/get_named_pose_bounds", name="uav2_start").bounds
    assert bounds.type == 3
    assert bounds.points[0].x == 20.0
    assert bounds.points[1].x > 0.1
    assert code_of(call_service(trio, "/get_named_pose_bounds", name="nowhere")) == NOT_FOUND


@pytest.mark.parametrize("plant", ["rigid_body", "kinematic", "identified"])
def test_other_plants_and_estimates_move_along(simulate, flat_data, plant):
    """A UAV that flies on an estimate estimates its new position at once, and stays there."""
    kind = flat_data["types"]["f450"]
    kind["plant"] = plant
    kind["sensors"] = [{"kind": "imu"}, {"kind": "gnss"}, {"kind": "estimate"}]
    flat_data["uavs"][0]["position_m"] = [0.0, 0.0, 6.0]
    simulation = simulate(flat_data)
    simulation.run(0.5)
    assert code_of(put(simulation, "uav1", (60.0, -40.0, 9.0))) == OK
    simulation.run(4.0)
    uav = simulation.uavs["uav1"]
    assert np.linalg.norm(uav.position_map - [60.0, -40.0, 9.0]) < 6.0
    assert np.linalg.norm(uav.velocity_map) < 1.5
