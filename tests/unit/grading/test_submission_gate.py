"""What a submission may read and command."""

from __future__ import annotations

import pytest
from assignments import ASSIGNMENT, write_assignment

from volery.core.errors import BridgeError
from volery.grading import load_assignment
from volery.grading.submission_gate import SubmissionGate


@pytest.fixture
def gate(tmp_path):
    """Returns the gate of an assignment that also shares the odometry of uav2."""
    text = 'reads = ["/uav2/odom"]\nwrites = ["/team/*"]\nperiod_s = 0.05\n' + ASSIGNMENT
    return SubmissionGate(load_assignment(write_assignment(tmp_path, text)))


@pytest.mark.parametrize(
    "operation",
    [
        {"op": "subscribe", "topic": "/uav1/odom"},
        {"op": "subscribe", "topic": "uav1/laser/horizontal/scan"},
        {"op": "subscribe", "topic": "/uav2/odom"},
        {"op": "subscribe", "topic": "/clock"},
        {"op": "subscribe", "topic": "/volery/lock_step/pilot/go"},
        {"op": "advertise", "topic": "/volery/nodes/uav1/pilot"},
        {"op": "publish", "topic": "/uav1/cmd_vel"},
        {"op": "publish", "topic": "/team/plan"},
        {"op": "call_service", "service": "/uav1/land"},
        {"op": "call_service", "service": "/rosapi/topic_type"},
        {"op": "unsubscribe", "topic": "/clock"},
    ],
)
def test_its_own_uav_is_free(gate, operation):
    assert gate.check(operation)


@pytest.mark.parametrize(
    "operation",
    [
        {"op": "subscribe", "topic": "/uav1/ground_truth/odom"},
        {"op": "subscribe", "topic": "/ground_truth/tf"},
        {"op": "subscribe", "topic": "/volery/scenario"},
        {"op": "subscribe", "topic": "/volery/vehicles"},
        {"op": "subscribe", "topic": "/uav2/imu"},
        {"op": "subscribe"},
        {"op": "publish", "topic": "/uav2/cmd_vel"},
        {"op": "publish", "topic": "/uav1/pose_command"},
        {"op": "publish", "topic": "/clock"},
        {"op": "call_service", "service": "/volery/reset_uav"},
        {"op": "call_service", "service": "/set_entity_state"},
        {"op": "call_service", "service": "/reset_simulation"},
        {"op": "call_service", "service": "/rosapi/set_param"},
        {"op": "call_service"},
        {"op": "advertise_service", "service": "/volery/status"},
        {"op": "send_action_goal", "action": "/simulate_steps"},
        {"op": "no_such_operation", "topic": "/uav1/odom"},
    ],
)
def test_all_else_is_refused(gate, operation):
    with pytest.raises(BridgeError, match="a submission may not"):
        gate.check(operation)


def test_the_assignment_sets_the_terms_of_the_lock_step(gate):
    asked = {"name": "pilot", "period_s": 5.0, "timeout_s": 1e9, "stop_on_timeout": True}
    operation = {"op": "call_service", "service": "/volery/join_lock_step", "args": asked}
    assert gate.check(operation)
    assert operation["args"] == {
        "name": "pilot",
        "period_s": 0.05,
        "timeout_s": 60.0,
        "stop_on_timeout": False,
        "supports_reset": False,
        "meets_at_start": True,
    }
