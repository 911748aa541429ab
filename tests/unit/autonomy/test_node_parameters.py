"""Parameters that would make a vehicle fly into something are refused at a node's start."""

import math

import pytest
from node_bench import NodeBench

from volery.autonomy.avoidance.gap_following import GapFollowing
from volery.autonomy.mapping.mapping_node import Mapping
from volery.autonomy.mapping.merging_node import MapMerging
from volery.autonomy.planning.exploration_node import Exploration
from volery.autonomy.planning.global_planner import GlobalPlanner
from volery.autonomy.planning.local_planner import LocalPlanner
from volery.autonomy.planning.trajectory_follower import TrajectoryFollower
from volery.autonomy.slam.planar_node import PlanarSlam
from volery.autonomy.slam.slam_node import Slam
from volery.core.errors import GraphError, NodeError

NAN, INF = math.nan, math.inf


@pytest.mark.parametrize("node", [Slam, Mapping, LocalPlanner, GapFollowing])
@pytest.mark.parametrize("name", ["level_mount", "nodding_mount"])
@pytest.mark.parametrize("value", [[], [0.0, 0.0], [0.0] * 4, [0.0, NAN, 0.0], ["0", 0.0, 0.0]])
def test_a_mount_is_three_finite_numbers(node, name, value):
    with pytest.raises((NodeError, GraphError), match=rf"{name}.* finite"):
        NodeBench().start(node, **{name: value})


@pytest.mark.parametrize(
    ("node", "name", "value"),
    [
        (Slam, "initial_pose", [0.0, 0.0, INF, 0.0]),
        (Slam, "imu_noise", [0.1] * 5 + [NAN]),
        (PlanarSlam, "initial_pose", [NAN] * 4),
        (PlanarSlam, "mount", [0.0] * 5 + [INF]),
        (GlobalPlanner, "heights_m", [2.0]),
        (GlobalPlanner, "heights_m", [4.0, 2.0]),
    ],
)
def test_lists_of_another_length_or_not_finite_are_refused(node, name, value):
    with pytest.raises((NodeError, GraphError), match=rf"{name}.* (is|not) "):
        NodeBench().start(node, **{name: value})


@pytest.mark.parametrize(
    ("node", "names"),
    [
        (LocalPlanner, "safe_radius_m speed_m_s acceleration_m_s2 height_m"),
        (LocalPlanner, "resolution_m start_delay_s acceptance_radius_m"),
        (LocalPlanner, "scan_rate_hz separation_m period_s"),
        (GapFollowing, "height_m speed_m_s safe_radius_m deceleration_m_s2"),
        (GlobalPlanner, "height_m safe_radius_m max_iterations resolution_m"),
        (Exploration, "view_radius_m resolution_m"),
        (TrajectoryFollower, "gain lookahead_s"),
        (
            Mapping,
            "resolution_m max_range_m beam_step scan_rate_hz extent_m max_nodes half_height_m",
        ),
        (Mapping, "grid_resolution_m voxels_period_s grid_period_s"),
        (MapMerging, "resolution_m max_cells period_s"),
        (Slam, "max_range_m landed_height_m scan_rate_hz odom_rate_hz pose_rate_hz"),
        (PlanarSlam, "min_range_m max_range_m"),
    ],
)
def test_numbers_below_what_makes_sense_are_refused(node, names):
    for name in names.split():
        for value in (-1, -3.0, NAN, INF):
            with pytest.raises(GraphError, match=rf"parameter '{name}' must be "):
                NodeBench().start(node, **{name: value})


def test_a_planner_in_flight_refuses_them_too():
    bench = NodeBench()
    bench.start(LocalPlanner)
    speed = bench.graph.parameters.get("/uav1/local_planner", "speed_m_s")
    for value in (-1.0, 0, NAN, INF):
        with pytest.raises(GraphError, match=r"'speed_m_s' must be 0\.1 or more, not"):
            speed.set(value)
    assert speed.value == 3.0
    speed.set(4)
    assert speed.value == 4
