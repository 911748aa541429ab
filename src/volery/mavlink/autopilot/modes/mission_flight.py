"""Flies missions, one item after the other."""

from __future__ import annotations

import math

from volery.mavlink.autopilot.context import AutopilotContext
from volery.mavlink.autopilot.modes import mode_transitions, payload_items
from volery.mavlink.autopilot.modes.legs import bearing, fly_leg
from volery.mavlink.autopilot.modes.modes import Mode
from volery.mavlink.autopilot.protocols import plans
from volery.mavlink.autopilot.protocols.item_positions import item_position
from volery.mavlink.autopilot.safety import home
from volery.mavlink.autopilot.state import Mission, MissionLeg
from volery.mavlink.autopilot.vehicle import FlightState
from volery.mavlink.codec import dialect

_FACES_RAD = math.radians(5.0)
"""Yaw error below which a heading is reached (modelling choice)."""
_MIN_LED_TURN_RAD, _LED_RAD_S = math.radians(175.0), math.radians(45.0)
"""Turn from which the heading is led, so that it goes the right way round, and the rate of leading
(modelling choices)."""
_LOITER_RADIUS_M = 80.0
"""Radius of items without one: the default of PX4's NAV_LOITER_RAD."""
_FACING = plans.PLACED - {plans.LAND, plans.TAKE_OFF}
"""Items on whose leg the UAV faces a region of interest."""
_MAX_STEPS = 2 * plans.MAX_ITEMS[plans.MISSION]
"""Limit of items passed at one instant, so that jumps cannot loop forever."""


def fly(context: AutopilotContext, state: FlightState) -> None:
    """Continues the mission; at its end the UAV holds its position."""
    memory = context.memory
    mission, items = memory.mission, memory.plans[plans.MISSION]
    if mission.complete or mission.stays or not items:
        if memory.leg is not None and state.mode != "LANDED":
            fly_leg(context, memory.leg)
        return
    for _ in range(_MAX_STEPS):
        if mission is not memory.mission or mission.complete or memory.mode is not Mode.MISSION:
            return
        _face_interest(context, mission, items[mission.current])
        if not _do(context, mission, items[mission.current], state):
            return
        _complete_item(context, mission)
        if memory.mission.stays:
            return


def _face_interest(context: AutopilotContext, mission: Mission, item: plans.MissionItem) -> None:
    """Faces the region of interest during a leg, as PX4's multicopters do."""
    leg = context.memory.leg
    if mission.interest is None or leg is None or leg.locked or item.command not in _FACING:
        return
    x, y, _ = mission.interest
    away = math.hypot(x - context.state.position[0], y - context.state.position[1])
    if away > float(context.parameter("NAV_ACC_RAD")):
        leg.yaw = bearing(context, mission.interest)


def _complete_item(context: AutopilotContext, mission: Mission) -> None:
    """Reports that the current item is done, and proceeds to the next one."""
    mission.reached = mission.current
    context.links.send(dialect().MAVLink_mission_item_reached_message(mission.current))
    items = context.memory.plans[plans.MISSION]
    item = items[mission.current]
    mission.stays = not item.goes_on and item.command != plans.JUMP
    if mission.stays:  # until a client chooses another item
        return
    _advance(mission, items)
    if mission.complete:
        mission.speed = math.nan
        if context.memory.mode is Mode.MISSION:  # else its last item was a return
            landed = context.state.mode == "LANDED"
            context.report(6, f"Mission finished, {'landed' if landed else 'loitering'}")


def _advance(mission: Mission, items: list[plans.MissionItem]) -> None:
    item = items[mission.current]
    mission.entered = mission.waiting = False
    following = mission.current + 1
    if item.command == plans.JUMP:
        repeats = int(item.params[1])
        left = mission.jumps_left.get(mission.current, repeats)
        if repeats < 0 or left > 0:
            mission.jumps_left[mission.current] = left - 1
            following = int(item.params[0])
        else:
            mission.jumps_left.pop(mission.current, None)
    if following >= len(items):
        mission.complete = True
    else:
        mission.current = following


def _do(
    context: AutopilotContext, mission: Mission, item: plans.MissionItem, state: FlightState
) -> bool:
    """Executes an item; returns whether it is done."""
    if state.mode == "LANDED" and item.command != plans.TAKE_OFF:
        return _do_on_ground(context, mission, item, state)
    doing = {
        plans.TAKE_OFF: _take_off,
        plans.WAYPOINT: _waypoint,
        plans.LOITER_TIME: _waypoint,
        plans.LOITER_UNLIMITED: _waypoint,
        plans.LOITER_TO_ALTITUDE: _change_height,
        plans.LAND: _land,
        plans.DELAY: _delay,
        plans.CONDITION_DELAY: _delay,
        plans.CONDITION_YAW: _face,
    }.get(item.command)
    if doing is not None:
        return doing(context, mission, item, state)
    if item.command == plans.RETURN_TO_LAUNCH:
        mode_transitions.enter(context, Mode.RETURN)
    return _set(context, mission, item)


def _do_on_ground(
    context: AutopilotContext, mission: Mission, item: plans.MissionItem, state: FlightState
) -> bool:
    """Executes an item on the ground; a position starts a take-off, as in PX4."""
    if item.command == plans.LAND:
        return True
    if item.command in (plans.DELAY, plans.CONDITION_DELAY):
        return _delay(context, mission, item, state)
    if item.placed and item.command in plans.PLACED:
        if context.memory.order != "take_off":
            mode_transitions.rise(context)
        return False
    return item.command == plans.RETURN_TO_LAUNCH or _set(context, mission, item)


def _set(context: AutopilotContext, mission: Mission, item: plans.MissionItem) -> bool:
    """Executes an item that takes no time."""
    if item.command == plans.CHANGE_SPEED:
        speed = item.params[1]
        mission.speed = speed if speed > 0.0 else math.nan
    elif item.command in payload_items.INTEREST:
        has_position = payload_items.is_roi_location(item.command)
        mission.interest = item_position(context, item) if has_position else None
    elif item.command == plans.SET_HOME:
        if item.params[0] == 1.0 or not item.placed:
            home.set_here(context)
        else:
            height = item_position(context, item)[2]
            why = home.choose(context, item.latitude, item.longitude, height)
            if why:
                context.report(4, why)
    return True


def _take_off(
    context: AutopilotContext, mission: Mission, item: plans.MissionItem, state: FlightState
) -> bool:
    """Handles a take-off: climbs, then flies to the item's position, if it has one, as PX4 does."""
    memory = context.memory
    position = item_position(context, item)
    z = position[2]
    if state.mode == "LANDED":
        if memory.order != "take_off":
            memory.take_off_height = max(z - state.position[2], 0.5)
            mode_transitions.rise(context)
        return False
    x, y = position[:2] if item.placed else state.position[:2]
    if memory.order == "take_off":
        aside = math.dist((x, y), state.position[:2]) > float(context.parameter("NAV_ACC_RAD"))
        if not aside:
            return state.mode == "HOLD" or _near_height(context, z)
        if state.mode != "HOLD":
            return False
    if not mission.entered or memory.leg is None:
        mission.entered = True
        mode_transitions.go_to(context, (x, y, max(z, state.position[2])), None)
    return memory.leg is None or fly_leg(context, memory.leg)


def _waypoint(
    context: AutopilotContext, mission: Mission, item: plans.MissionItem, state: FlightState
) -> bool:
    memory = context.memory
    if state.mode == "TAKE_OFF":
        return False
    if not mission.entered or memory.leg is None:
        mission.entered = True
        target = item_position(context, item)
        yaw = None if item.command == plans.LOITER_TIME else _yaw_of(item)
        facing = bearing(context, target) if yaw is None else yaw
        memory.leg = MissionLeg(target, facing, mode_transitions.cruise(context))
    leg = memory.leg
    rests = fly_leg(context, leg)
    last = mission.current + 1 == len(memory.plans[plans.MISSION])
    wait_s = item.params[0] if item.command != plans.LOITER_UNLIMITED else math.inf
    waits = math.isfinite(wait_s) and wait_s > 0.0
    if not (rests if last or waits or mission.waiting else _is_near(context, item, leg)):
        return mission.waiting and _has_waited(context, mission, wait_s)
    if item.command == plans.LOITER_UNLIMITED:
        return False
    if not waits:
        return True
    if not mission.waiting:
        mission.waiting, mission.since_ns = True, memory.now_ns
    return _has_waited(context, mission, wait_s)


def _yaw_of(item: plans.MissionItem) -> float | None:
    """Returns the yaw of an item, rad, map; its parameter counts clockwise from north."""
    clockwise = item.params[3]
    return 0.5 * math.pi - math.radians(clockwise) if math.isfinite(clockwise) else None


def _change_height(
    context: AutopilotContext, mission: Mission, item: plans.MissionItem, state: FlightState
) -> bool:
    """Handles LOITER_TO_ALT: approaches at the current height, then changes the height."""
    memory = context.memory
    if state.mode == "TAKE_OFF":
        return False
    x, y, z = item_position(context, item)
    if not mission.entered or memory.leg is None:
        mission.entered = True
        target = (x, y, state.position[2])
        memory.leg = MissionLeg(target, bearing(context, target), mode_transitions.cruise(context))
    own = abs(item.params[1])
    radius = own if math.isfinite(own) and own > 0.0 else _LOITER_RADIUS_M
    radius += float(context.parameter("NAV_ACC_RAD"))
    level = math.hypot(x - state.position[0], y - state.position[1])
    if level <= radius and memory.leg.target[2] != z:
        memory.leg = MissionLeg((x, y, z), memory.leg.yaw, memory.leg.speed)
    fly_leg(context, memory.leg)
    return level <= radius and _near_height(context, z)


def _is_near(context: AutopilotContext, item: plans.MissionItem, leg: MissionLeg) -> bool:
    """Returns whether the UAV is within the acceptance radius, the item's own or NAV_ACC_RAD."""
    own = item.params[1] if item.command == plans.WAYPOINT else 0.0
    radius = own if math.isfinite(own) and own > 0.0 else float(context.parameter("NAV_ACC_RAD"))
    x, y, _ = context.state.position
    level = math.hypot(leg.target[0] - x, leg.target[1] - y)
    return level < radius and _near_height(context, leg.target[2])


def _near_height(context: AutopilotContext, z: float) -> bool:
    return abs(z - context.state.position[2]) < float(context.parameter("NAV_MC_ALT_RAD"))


def _land(
    context: AutopilotContext, mission: Mission, item: plans.MissionItem, state: FlightState
) -> bool:
    memory = context.memory
    if memory.order == "land":
        return False  # done once the UAV is on the ground
    if not mission.entered:
        mission.entered = True
        x, y, z = state.position
        if item.placed:
            x, y, _ = item_position(context, item)
        memory.leg = MissionLeg((x, y, z), _yaw_of(item), mode_transitions.cruise(context))
    if memory.leg is not None and not fly_leg(context, memory.leg):
        return False
    memory.leg = None
    mode_transitions.order(context, "land", context.vehicle.land())
    return False


def _delay(
    context: AutopilotContext, mission: Mission, item: plans.MissionItem, state: FlightState
) -> bool:
    if context.memory.leg is not None and state.mode != "LANDED":
        fly_leg(context, context.memory.leg)
    if not mission.waiting:
        mission.waiting, mission.since_ns = True, context.memory.now_ns
    return _has_waited(context, mission, item.params[0])


def _face(
    context: AutopilotContext, mission: Mission, item: plans.MissionItem, state: FlightState
) -> bool:
    """Handles CONDITION_YAW: turns on the spot, relative or clockwise from north.

    A turn with a rate, or the longer way round, leads the heading along.
    """
    memory = context.memory
    rate_deg = item.params[1]
    if not mission.entered:
        mission.entered, mission.since_ns = True, memory.now_ns
        mission.turn = (context.yaw, _turn_of(item, context.yaw))
    start, turn = mission.turn
    rate = math.radians(rate_deg) if rate_deg > 0.0 else math.inf
    if abs(turn) > _MIN_LED_TURN_RAD:
        rate = min(rate, _LED_RAD_S)
    elapsed_s = (memory.now_ns - mission.since_ns) * 1e-9
    led = abs(turn) if math.isinf(rate) else min(rate * elapsed_s, abs(turn))
    yaw = math.remainder(start + math.copysign(led, turn), 2.0 * math.pi)
    if memory.leg is None or memory.leg.yaw != yaw:
        target = state.position if memory.leg is None else memory.leg.target
        memory.leg = MissionLeg(target, yaw, mode_transitions.cruise(context))
    fly_leg(context, memory.leg)
    return led == abs(turn) and abs(math.remainder(yaw - context.yaw, 2.0 * math.pi)) < _FACES_RAD


def _turn_of(item: plans.MissionItem, yaw: float) -> float:
    """Returns by how much a CONDITION_YAW turns from a yaw, rad, counter-clockwise.

    An angle from north is turned to in the direction of the third parameter, else the shorter way.
    """
    angle, _, direction, relative = item.params
    if relative == 1.0:
        return math.radians(angle) * (1.0 if direction == -1.0 else -1.0)
    turn = math.remainder(0.5 * math.pi - math.radians(angle) - yaw, 2.0 * math.pi)
    if direction in (-1.0, 1.0) and abs(turn) > _FACES_RAD and direction * turn > 0.0:
        turn -= math.copysign(2.0 * math.pi, turn)
    return turn


def _has_waited(context: AutopilotContext, mission: Mission, seconds: float) -> bool:
    return context.memory.now_ns - mission.since_ns >= seconds * 1e9
