"""The mission protocol: uploads and downloads plans of missions, fences and rally points.

One transfer per kind at a time; a second client is denied. As in PX4, the receiver repeats a
request each 250 ms; here it gives up after 5 s.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from volery.mavlink.autopilot import feasibility, plans
from volery.mavlink.autopilot.state import Mission, MissionTransfer
from volery.mavlink.codec import dialect

if TYPE_CHECKING:
    from volery.mavlink.autopilot.core import Autopilot
    from volery.mavlink.autopilot.state import Source

RETRY_NS = 250_000_000
GIVE_UP_NS = 5_000_000_000


def begin_upload(autopilot: Autopilot, source: Source, message: Any) -> None:
    """Answers MISSION_COUNT by a request for the first item."""
    kind, count = int(message.mission_type), int(message.count)
    if kind not in plans.MOST_ITEMS:
        _answer(autopilot, source, plans.UNSUPPORTED, kind)
        return
    running = autopilot.memory.transfers.get(kind)
    if running is not None and running.source != source and running.upload:
        _answer(autopilot, source, plans.DENIED, kind)
        return
    if count > plans.MOST_ITEMS[kind]:
        _answer(autopilot, source, plans.NO_SPACE, kind)
        return
    now_ns = autopilot.memory.now_ns
    transfer = MissionTransfer(kind, source, True, count, time_ns=now_ns)
    if count == 0:
        _take_over(autopilot, transfer)
        return
    autopilot.memory.transfers[kind] = transfer
    autopilot.memory.last_items.pop(kind, None)
    _ask(autopilot, transfer)


def take_item(autopilot: Autopilot, source: Source, message: Any) -> None:
    """Stores the requested item; the last one may come again, because its ACK was lost."""
    kind, sequence = int(message.mission_type), int(message.seq)
    transfer = autopilot.memory.transfers.get(kind)
    if transfer is None or not transfer.upload or transfer.source != source:
        if transfer is None and kind in plans.MOST_ITEMS:
            repeated = autopilot.memory.last_items.get(kind) == (source, sequence)
            _answer(autopilot, source, plans.ACCEPTED if repeated else plans.ERROR, kind)
        return
    transfer.time_ns = autopilot.memory.now_ns
    if sequence != len(transfer.items):
        return  # early or repeated: the awaited item is requested again, as in PX4
    item = plans.item_of(message)
    fault = plans.fault_of(item, kind, transfer.count)
    if fault:
        _end(autopilot, transfer, fault)
        return
    transfer.items.append(item)
    if len(transfer.items) < transfer.count:
        _ask(autopilot, transfer)
    elif kind == plans.FENCE and not plans.polygons_are_whole(transfer.items):
        _end(autopilot, transfer, plans.INVALID)
    elif kind == plans.MISSION and plans.flies_for_ever(transfer.items):
        autopilot.say(2, "Mission rejected: its jumps go round for ever")
        _end(autopilot, transfer, plans.INVALID)
    else:
        _take_over(autopilot, transfer)


def begin_download(autopilot: Autopilot, source: Source, message: Any) -> None:
    """Answers MISSION_REQUEST_LIST with the number of items."""
    kind = int(message.mission_type)
    if kind not in plans.MOST_ITEMS:
        _answer(autopilot, source, plans.UNSUPPORTED, kind)
        return
    link, system, component = source
    count = len(autopilot.memory.plans[kind])
    autopilot.send(dialect().MAVLink_mission_count_message(system, component, count, kind), link)


def send_item(autopilot: Autopilot, source: Source, message: Any) -> None:
    """Sends one item, in the requested form."""
    kind, sequence = int(message.mission_type), int(message.seq)
    items = autopilot.memory.plans.get(kind)
    if items is None or sequence >= len(items):
        _answer(autopilot, source, plans.INVALID_SEQUENCE, kind)
        return
    link, system, component = source
    item, current = items[sequence], kind == 0 and sequence == autopilot.memory.mission.current
    whole = message.get_type() == "MISSION_REQUEST_INT"
    name = "mission_item_int" if whole else "mission_item"
    places = (item.latitude, item.longitude)
    if whole:
        x, y = (-(2**31) if part != part else round(part * 1e7) for part in places)  # noqa: PLR0124
    else:
        x, y = places  # type: ignore[assignment]
    message_class = getattr(dialect(), f"MAVLink_{name}_message")
    head = (system, component, sequence, item.frame, item.command, int(current), int(item.goes_on))
    autopilot.send(message_class(*head, *item.params, x, y, item.altitude, kind), link)


def take_ack(autopilot: Autopilot, source: Source, message: Any) -> None:
    """Ends an upload that its sender cancels; downloads have no state."""
    kind = int(message.mission_type)
    transfer = autopilot.memory.transfers.get(kind)
    if transfer is None or not transfer.upload or transfer.source != source:
        return
    if int(message.type) == plans.CANCELLED:
        del autopilot.memory.transfers[kind]


def clear(autopilot: Autopilot, source: Source, message: Any) -> None:
    """Deletes one plan or all plans."""
    kind = int(message.mission_type)
    kinds = tuple(plans.MOST_ITEMS) if kind == plans.ALL else (kind,)
    if not set(kinds) <= set(plans.MOST_ITEMS):
        _answer(autopilot, source, plans.UNSUPPORTED, kind)
        return
    for one in kinds:
        autopilot.memory.transfers.pop(one, None)
        _replace(autopilot, one, [])
    _answer(autopilot, source, plans.ACCEPTED, kind)


def set_current(autopilot: Autopilot, _source: Source, message: Any) -> None:
    """Handles the old MISSION_SET_CURRENT, which has no answer."""
    jump_to(autopilot, int(message.seq))


def jump_to(autopilot: Autopilot, sequence: int) -> bool:
    """Makes an item the current one; returns whether the item exists."""
    if not 0 <= sequence < len(autopilot.memory.plans[plans.MISSION]):
        return False
    speed = autopilot.memory.mission.speed
    autopilot.memory.mission = Mission(current=sequence, speed=speed)
    autopilot.memory.leg = None
    return True


def keep_transfers_going(autopilot: Autopilot) -> None:
    """Repeats unanswered requests and drops silent peers."""
    now_ns = autopilot.memory.now_ns
    for transfer in tuple(autopilot.memory.transfers.values()):
        if now_ns - transfer.time_ns > GIVE_UP_NS:
            _end(autopilot, transfer, plans.CANCELLED)
        elif now_ns - transfer.asked_ns > RETRY_NS:
            _ask(autopilot, transfer)


def _ask(autopilot: Autopilot, transfer: MissionTransfer) -> None:
    link, system, component = transfer.source
    transfer.asked_ns = autopilot.memory.now_ns
    request = dialect().MAVLink_mission_request_int_message
    autopilot.send(request(system, component, len(transfer.items), transfer.kind), link)


def _end(autopilot: Autopilot, transfer: MissionTransfer, result: int) -> None:
    autopilot.memory.transfers.pop(transfer.kind, None)
    _answer(autopilot, transfer.source, result, transfer.kind)


def _take_over(autopilot: Autopilot, transfer: MissionTransfer) -> None:
    _replace(autopilot, transfer.kind, transfer.items)
    autopilot.memory.last_items[transfer.kind] = (transfer.source, transfer.count - 1)
    _end(autopilot, transfer, plans.ACCEPTED)
    if transfer.kind in (plans.MISSION, plans.FENCE):
        feasibility.look(autopilot)


def _replace(autopilot: Autopilot, kind: int, items: list[plans.MissionItem]) -> None:
    autopilot.memory.plans[kind] = items
    if kind == plans.MISSION:
        autopilot.memory.mission = Mission()
        autopilot.memory.leg = None


def _answer(autopilot: Autopilot, source: Source, result: int, kind: int) -> None:
    link, system, component = source
    autopilot.send(dialect().MAVLink_mission_ack_message(system, component, result, kind), link)
