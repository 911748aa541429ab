"""Steps a paused simulation: a service that responds after the last step, and an action."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from volery.core.errors import CommandError
from volery.core.plurals import counted
from volery.engine.single_steps import StepRequest
from volery.graph.actions import Goal
from volery.runtime.services.results import (
    RefusedError,
    ResultCode,
    Settle,
    failed,
    filled,
    offer_result_later,
    result,
)

if TYPE_CHECKING:
    from volery.runtime.simulation import Simulation

_SERVICE = "simulation_interfaces/srv/StepSimulation"
_ACTION = "simulation_interfaces/action/SimulateSteps"
_MOST_STEPS = 1_000_000_000
CANCELLED = "cancelled"


def offer_steps(simulation: Simulation) -> None:
    """Creates the service `/step_simulation` and the action `/simulate_steps`.

    Steps are physics steps; the thread that runs the simulation makes them.
    """

    def step(request: Any, settle: Settle) -> None:
        def tell(steps: StepRequest) -> None:
            if steps.over:
                settle(_interrupted(steps) or {})

        _begin(simulation, int(request.steps), tell)

    offer_result_later(simulation.graph, "/step_simulation", _SERVICE, step)
    simulation.graph.actions.create_server(
        "/simulate_steps", _ACTION, lambda goal: _take(simulation, goal)
    )


def _begin(simulation: Simulation, steps: int, tell: Any) -> StepRequest:
    if not 1 <= steps <= _MOST_STEPS:
        raise RefusedError(
            ResultCode.OPERATION_FAILED, f"steps must be 1 to {_MOST_STEPS}, not {steps}"
        )
    if simulation.end.waits:
        raise RefusedError(ResultCode.INCORRECT_STATE, simulation.end.notice)
    if not simulation.paused:
        raise RefusedError(
            ResultCode.INCORRECT_STATE, "steps need a paused simulation; pause it first"
        )
    try:
        return simulation.single_step(steps, tell)
    except CommandError as error:  # the simulation was resumed meanwhile
        raise RefusedError(ResultCode.INCORRECT_STATE, str(error)) from None


def _take(simulation: Simulation, goal: Goal) -> None:
    def tell(steps: StepRequest) -> None:
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
        request = _begin(simulation, int(goal.request.steps), tell)
    except RefusedError as refusal:
        goal.abort(_result(failed(refusal)))
        return
    goal.when_cancelled(lambda: simulation.cancel_steps(request))


def _interrupted(steps: StepRequest) -> RefusedError | None:
    """Returns why not all steps were made; None if all were."""
    if not steps.left:
        return None
    reason = f"{steps.made} of {counted(steps.steps, 'step')} made: {steps.reason}"
    return RefusedError(ResultCode.OPERATION_FAILED, reason)


def _result(code: Any) -> Any:
    return filled(f"{_ACTION}_Result", {"result": code})
