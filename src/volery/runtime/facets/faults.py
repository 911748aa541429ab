"""The faults of a simulation: of motors, sensors, GNSS and radio, jammers, gusts, displacements."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from volery.engine.faults import FaultPlan, uav_of
from volery.graph.graph import Graph
from volery.scenario.faults import Fault, LastingFault, parse_fault


class SimulationFaults:
    """Injects and ends faults while a simulation runs.

    check_open: raises `CommandError` once the simulation is closed.
    """

    def __init__(self, plan: FaultPlan, graph: Graph, check_open: Callable[[], None]) -> None:
        self._plan, self._graph, self._check_open = plan, graph, check_open

    def __repr__(self) -> str:
        return f"<active faults: {', '.join(map(_text_of, self.active)) or 'none'}>"

    @property
    def active(self) -> tuple[LastingFault, ...]:
        """Faults that have begun and not ended, oldest first; `at_s` is when they began.

        Gusts and displacements end by themselves and are not among them.
        """
        return self._plan.active

    def inject(self, fault: Fault | Mapping[str, Any]) -> None:
        """Injects a fault as in a scenario's `faults`, at once if its time is past.

        `simulation.faults.inject({"kind": "motor", "uav": "uav1", "rotor": 0})`. Raises
        `CommandError` for an impossible one.
        """
        self._check_open()
        self._plan.add(parse_fault(fault), client=self._graph.acting_client)

    def end(self, fault: Fault | Mapping[str, Any]) -> None:
        """Ends a fault that has begun; it is described as for `inject`, its times do not count.

        Has no effect without such a fault. Raises `CommandError` for an impossible one, and for a
        gust or a displacement.
        """
        self._check_open()
        self._plan.end(parse_fault(fault), client=self._graph.acting_client)


def _text_of(fault: LastingFault) -> str:
    kind, uav = fault.model_dump()["kind"], uav_of(fault)
    return kind if uav is None else f"{kind} of {uav}"
