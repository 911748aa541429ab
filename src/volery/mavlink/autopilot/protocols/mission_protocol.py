"""The mission protocol: uploads and downloads plans of missions, fences and rally points.

One transfer per kind at a time; a second client is denied. As in PX4, the receiver repeats a
request each 250 ms; here it gives up after 5 s.
"""

from __future__ import annotations

import math
from typing import Any

from volery.mavlink.autopilot.context import AutopilotContext
from volery.mavlink.autopilot.messages import telemetry
from volery.mavlink.autopilot.modes import mode_transitions
from volery.mavlink.autopilot.modes.modes import Mode
from volery.mavlink.autopilot.protocols import plans
from volery.mavlink.autopilot.protocols.item_positions import item_position
from volery.mavlink.autopilot.safety import feasibility
from volery.mavlink.autopilot.state import Mission, MissionTransfer, Source
from volery.mavlink.codec import dialect

RETRY_NS = 250_000_000
GIVE_UP_NS = 5_000_000_000


def begin_upload(context: AutopilotContext, source: Source, message: Any) -> None:
    """Answers MISSION_COUNT by a request for the first item."""
    kind, count = int(message.mission_type), int(message.count)
    if kind not in plans.MAX_ITEMS:
        _acknowledge(context, source, plans.UNSUPPORTED, kind)
        return
    running = context.memory.transfers.get(kind)
    if running is not None and running.source != source and running.upload:
        _acknowledge(context, source, plans.DENIED, kind)
        return
    if count > plans.MAX_ITEMS[kind]:
        _acknowledge(context, source, plans.NO_SPACE, kind)
        return
    now_ns = context.memory.now_ns
    transfer = MissionTransfer(kind, source, True, count, time_ns=now_ns)
    if count == 0:
        _take_over(context, transfer)
        return
    context.memory.transfers[kind] = transfer
    context.memory.last_items.pop(kind, None)
    _request_item(context, transfer)


def take_item(context: AutopilotContext, source: Source, message: Any) -> None:
    """Stores the requested item; the last one may come again, because its ACK was lost."""
    kind, sequence = int(message.mission_type), int(message.seq)
    transfer = context.memory.transfers.get(kind)
    if transfer is None or not transfer.upload or transfer.source != source:
        if transfer is None and kind in plans.MAX_ITEMS:
            repeated = context.memory.last_items.get(kind) == (source, sequence)
            _acknowledge(context, source, plans.ACCEPTED if repeated else plans.ERROR, kind)
        return
    transfer.time_ns = context.memory.now_ns
    if sequence != len(transfer.items):
        return  # early or repeated: the awaited item is requested again, as in PX4
    item = plans.item_of(message)
    fault = plans.fault_of(item, kind, transfer.count)
    if fault:
        _end(context, transfer, fault)
        return
    transfer.items.append(item)
    if int(message.current) == 1:
        transfer.first = sequence
    if len(transfer.items) < transfer.count:
        _request_item(context, transfer)
    elif kind == plans.FENCE and not plans.polygons_are_whole(transfer.items):
        _end(context, transfer, plans.INVALID)
    elif kind == plans.MISSION and plans.flies_for_ever(transfer.items):
        context.report(2, "Mission rejected: its jumps go round for ever")
        _end(context, transfer, plans.INVALID)
    else:
        _take_over(context, transfer)


def begin_download(context: AutopilotContext, source: Source, message: Any) -> None:
    """Answers MISSION_REQUEST_LIST with the number of items."""
    kind = int(message.mission_type)
    if kind not in plans.MAX_ITEMS:
        _acknowledge(context, source, plans.UNSUPPORTED, kind)
        return
    link, system, component = source
    count = len(context.memory.plans[kind])
    context.links.send(
        dialect().MAVLink_mission_count_message(system, component, count, kind), link
    )


def send_item(context: AutopilotContext, source: Source, message: Any) -> None:
    """Sends one item, in the requested form."""
    kind, sequence = int(message.mission_type), int(message.seq)
    items = context.memory.plans.get(kind)
    if items is None or sequence >= len(items):
        _acknowledge(context, source, plans.INVALID_SEQUENCE, kind)
        return
    link, system, component = source
    item, current = items[sequence], kind == 0 and sequence == context.memory.mission.current
    whole = message.get_type() == "MISSION_REQUEST_INT"
    name = "mission_item_int" if whole else "mission_item"
    degrees = (item.latitude, item.longitude)
    if whole:
        x, y = (-(2**31) if part != part else round(part * 1e7) for part in degrees)  # noqa: PLR0124
    else:
        x, y = degrees  # type: ignore[assignment]
    message_class = getattr(dialect(), f"MAVLink_{name}_message")
    head = (system, component, sequence, item.frame, item.command, int(current), int(item.goes_on))
    context.links.send(message_class(*head, *item.params, x, y, item.altitude, kind), link)


def take_ack(context: AutopilotContext, source: Source, message: Any) -> None:
    """Ends an upload that its sender cancels; downloads have no state."""
    kind = int(message.mission_type)
    transfer = context.memory.transfers.get(kind)
    if transfer is None or not transfer.upload or transfer.source != source:
        return
    if int(message.type) == plans.CANCELLED:
        del context.memory.transfers[kind]


def clear(context: AutopilotContext, source: Source, message: Any) -> None:
    """Deletes one plan or all plans."""
    kind = int(message.mission_type)
    kinds = tuple(plans.MAX_ITEMS) if kind == plans.ALL else (kind,)
    if not set(kinds) <= set(plans.MAX_ITEMS):
        _acknowledge(context, source, plans.UNSUPPORTED, kind)
        return
    for one in kinds:
        context.memory.transfers.pop(one, None)
        _replace(context, one, [])
    _acknowledge(context, source, plans.ACCEPTED, kind)


def set_current(context: AutopilotContext, _source: Source, message: Any) -> None:
    """Handles the old MISSION_SET_CURRENT, which has no answer: PX4 says why it fails."""
    if not jump_to(context, int(message.seq), resets=False):
        context.report(2, "WPM: WP CURR CMD: Not in list")


def jump_to(context: AutopilotContext, sequence: int, *, resets: bool = True) -> bool:
    """Makes an item the current one and announces it; returns whether the item exists.

    resets: whether the counts of jumps start at zero.
    """
    if not 0 <= sequence < len(context.memory.plans[plans.MISSION]):
        return False
    before = context.memory.mission
    counts = {} if resets else before.jumps_left
    context.memory.mission = Mission(current=sequence, speed=before.speed, jumps_left=counts)
    context.memory.leg = None
    context.links.send(telemetry.mission_current(context))
    return True


def update_transfers(context: AutopilotContext) -> None:
    """Repeats unanswered requests and drops silent peers."""
    now_ns = context.memory.now_ns
    for transfer in tuple(context.memory.transfers.values()):
        if now_ns - transfer.time_ns > GIVE_UP_NS:
            _end(context, transfer, plans.CANCELLED)
        elif now_ns - transfer.requested_ns > RETRY_NS:
            _request_item(context, transfer)


def _request_item(context: AutopilotContext, transfer: MissionTransfer) -> None:
    link, system, component = transfer.source
    transfer.requested_ns = context.memory.now_ns
    request = dialect().MAVLink_mission_request_int_message
    context.links.send(request(system, component, len(transfer.items), transfer.kind), link)


def _end(context: AutopilotContext, transfer: MissionTransfer, result: int) -> None:
    context.memory.transfers.pop(transfer.kind, None)
    _acknowledge(context, transfer.source, result, transfer.kind)


def _take_over(context: AutopilotContext, transfer: MissionTransfer) -> None:
    _replace(context, transfer.kind, transfer.items)
    if transfer.kind == plans.MISSION:
        context.memory.mission.current = transfer.first
    context.memory.last_items[transfer.kind] = (transfer.source, transfer.count - 1)
    _end(context, transfer, plans.ACCEPTED)
    if transfer.kind in (plans.MISSION, plans.FENCE):
        _check_plans(context)


def _check_plans(context: AutopilotContext) -> None:
    """Checks a new mission or fence: reports a problem, and holds if the mission was active."""
    if context.memory.state is None:
        return
    why = feasibility.problem(context)
    if not why:
        _warn_of_far_start(context)
        return
    context.report(2, why)
    if context.memory.mode is Mode.MISSION and context.memory.armed:
        mode_transitions.enter(context, Mode.HOLD)


def _warn_of_far_start(context: AutopilotContext) -> None:
    """Warns of a first waypoint beyond MIS_DIST_1WP, which may still be flown."""
    limit = float(context.parameter("MIS_DIST_1WP"))
    items = context.memory.plans[plans.MISSION]
    first = next((item for item in items if item.command in plans.PLACED and item.placed), None)
    if first is None or limit <= 0.0:
        return
    home = context.memory.home_or_origin
    away = math.dist(item_position(context, first)[:2], home[:2])
    if away >= limit:
        context.report(
            2, f"First waypoint far away from home: {away:.0f}m. Correct mission loaded?"
        )


def _replace(context: AutopilotContext, kind: int, items: list[plans.MissionItem]) -> None:
    context.memory.plans[kind] = items
    if kind == plans.MISSION:
        context.memory.mission = Mission()
        context.memory.leg = None


def _acknowledge(context: AutopilotContext, source: Source, result: int, kind: int) -> None:
    link, system, component = source
    context.links.send(dialect().MAVLink_mission_ack_message(system, component, result, kind), link)
