"""Publishes `/volery/faults`: the active faults, as JSON, to external clients."""

from __future__ import annotations

import json
from typing import Any

from volery.engine.faults import FaultPlan
from volery.graph.graph import Graph
from volery.graph.messages import message_type
from volery.runtime.monitoring.live_topic import LiveTopic

TOPIC = "/volery/faults"
_TYPE = "std_msgs/msg/String"
_PERIOD_S = 1.0
_MIN_PERIOD_S = 0.1


def faults_topic(graph: Graph, plan: FaultPlan) -> LiveTopic:
    """Returns the topic of the faults that have begun and not ended, a list of tables.

    Each table is as in a scenario and in `/volery/inject_fault`; `at_s` is when the fault began.
    """

    def message() -> Any:
        active = [fault.model_dump(mode="json", exclude_none=True) for fault in plan.active]
        return message_type(_TYPE)(json.dumps(active))

    return LiveTopic(
        graph.advertise(TOPIC, _TYPE), message, lambda: plan.active, _PERIOD_S, _MIN_PERIOD_S
    )
