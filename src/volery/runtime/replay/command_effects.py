"""Classifies client commands by their effect on the flight."""

from __future__ import annotations

from enum import Enum

from volery.graph.session import ClientCommand

_STOPPED = 0
"""`simulation_interfaces/msg/SimulationState`: this one resets, the others change the pace."""

_PACE = {
    f"{package}/srv/{name}"
    for package, names in {
        "simulation_interfaces": ("StepSimulation", "LoadWorld", "UnloadWorld"),
        "volery_interfaces": (
            "SetSpeed",
            "StartRecording",
            "StopRecording",
            "LoadScenario",
            "PlayRecording",
        ),
    }.items()
    for name in names
}
_SET_STATE = "simulation_interfaces/srv/SetSimulationState"
_ASKING = {"simulation_interfaces": ("Get",), "volery_interfaces": ("Get", "List")}
_AT_THE_END = {
    "simulation_interfaces/srv/ResetSimulation",
    _SET_STATE,
    "volery_interfaces/srv/TakeControl",
    "volery_interfaces/srv/ReleaseControl",
    "volery_interfaces/srv/HandOver",
}
"""Services that leave the end of a scenario, or concern operators."""
CONTINUE_RUN = "/volery/continue_run"
_AT_THE_END_BY_NAME = {
    CONTINUE_RUN,
    "/volery/save_snapshot",
    "/volery/restore_snapshot",
    "/volery/delete_snapshot",
}
_SETS_PARAMETERS = {"rosapi_msgs/srv/SetParam", "rosapi_msgs/srv/DeleteParam"}


class CommandEffect(Enum):
    """Classifies the effect of a command on the flight."""

    QUERIES = "nothing: a query"
    PACES = "the pace, files, end or audience of the run, but no result"
    CHANGES = "the results"


def restarts(command: ClientCommand) -> bool:
    """Returns whether a command has an effect after the end of a scenario."""
    if command.kind == "call" and (
        command.type in _AT_THE_END or command.name in _AT_THE_END_BY_NAME
    ):
        return True
    return weight_of(command) is not CommandEffect.CHANGES


def weight_of(command: ClientCommand) -> CommandEffect:
    """Returns the effect of a command; unknown services count as changing the results."""
    if command.kind in ("publish", "answer", "failure"):
        return CommandEffect.CHANGES
    if command.kind != "call":
        return CommandEffect.PACES
    package, _, name = command.type.partition("/srv/")
    if name.startswith(_ASKING.get(package, ())):
        return CommandEffect.QUERIES
    if package == "rosapi_msgs" and command.type not in _SETS_PARAMETERS:
        return CommandEffect.QUERIES
    if command.type == _SET_STATE:
        state = _STOPPED if command.content is None else int(command.content.state.state)
        return CommandEffect.CHANGES if state == _STOPPED else CommandEffect.PACES
    return CommandEffect.PACES if command.type in _PACE else CommandEffect.CHANGES
