"""Steps a paused simulation: a service that responds after the last step, and an action."""

from __future__ import annotations

from typing import Any

from volery.core.errors import CommandError
from volery.core.plurals import counted
from volery.engine.single_steps import StepRequest
from volery.graph.actions import Goal
from volery.graph.graph import Graph
from volery.runtime.end_of_run import EndOfRun
from volery.runtime.facets.clock import SimulationClock
from volery.runtime.services.results import (
    RefusedError,
    ResultCode,
    Settle,
    failed,
    filled,
    offer_result_later,
    result,
)

_SERVICE = "simulation_interfaces/srv/StepSimulation"
_ACTION = "simulation_interfaces/action/SimulateSteps"
_MAX_STEPS = 1_000_000_000
CANCELLED = "cancelled"


def offer_steps(graph: Graph, clock: SimulationClock, end: EndOfRun) -> None:
    """Creates the service `/step_simulation` and the action `/simulate_steps`.

    Steps are physics steps; the thread that runs the simulation makes them.
    """

    def step(request: Any, settle: Settle) -> None:
        def report(steps: StepRequest) -> None:
            if steps.over:
                settle(_interrupted(steps) or {})

        _begin(clock, end, int(request.steps), report)

    offer_result_later(graph, "/step_simulation", _SERVICE, step)
    graph.actions.create_server("/simulate_steps", _ACTION, lambda goal: _take(clock, end, goal))


def _begin(clock: SimulationClock, end: EndOfRun, steps: int, on_report: Any) -> StepRequest:
    if not 1 <= steps <= _MAX_STEPS:
        raise RefusedError(
            ResultCode.OPERATION_FAILED, f"steps must be 1 to {_MAX_STEPS}, not {steps}"
        )
    if end.waits:
        raise RefusedError(ResultCode.INCORRECT_STATE, end.notice)
    if not clock.paused:
        raise RefusedError(
            ResultCode.INCORRECT_STATE, "steps need a paused simulation; pause it first"
        )
    try:
        return clock.single_step(steps, on_report)
    except CommandError as error:  # the simulation was resumed meanwhile
        raise RefusedError(ResultCode.INCORRECT_STATE, str(error)) from None


def _take(clock: SimulationClock, end: EndOfRun, goal: Goal) -> None:
    def report(steps: StepRequest) -> None:
        progress = {"completed_steps": steps.made, "remaining_steps": steps.left}
        goal.feedback(filled(f"{_ACTION}_Feedback", progress))
        if not steps.over:
            return
        interrupted = _interrupted(steps)
        if interrupted is None:
            goal.succeed(_result(result()))
        elif steps.reason == CANCELLED:
            goal.canceled(_result(failed(interrupted)))
        else:
            goal.abort(_result(failed(interrupted)))

    try:
        request = _begin(clock, end, int(goal.request.steps), report)
    except RefusedError as refusal:
        goal.abort(_result(failed(refusal)))
        return
    goal.when_cancelled(lambda: clock.cancel_steps(request))


def _interrupted(steps: StepRequest) -> RefusedError | None:
    """Returns why not all steps were made; None if all were."""
    if not steps.left:
        return None
    reason = f"{steps.made} of {counted(steps.steps, 'step')} made: {steps.reason}"
    return RefusedError(ResultCode.OPERATION_FAILED, reason)


def _result(code: Any) -> Any:
    return filled(f"{_ACTION}_Result", {"result": code})
