"""Publishes the poses of actors and receives poses of externally moved ones."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from volery.core.errors import CommandError
from volery.graph.graph import Graph
from volery.graph.messages import PoseStamped, Published, TFMessage, frame_of
from volery.publishing.transforms import transforms_in_map
from volery.runtime.facets.world import SimulationWorld
from volery.world.actors import MovingActors
from volery.world.actors.motions import GivenMotion

_PERIOD_S = 0.02


def offer_actors(
    graph: Graph, world: SimulationWorld, actors: MovingActors, every: Callable[..., None]
) -> None:
    """Publishes all actors on `/tf`, 50 times a second; subscribes to `/actors/NAME/pose`.

    A pose there, in the map frame, becomes the actor's pose; a zero quaternion keeps its heading.
    Invalid poses are ignored, as a topic has no response; actors that move by themselves have no
    such topic.
    """
    transforms = graph.advertise("/tf", TFMessage)

    def publish() -> None:
        time_ns = graph.now_ns()
        transforms.publish(transforms_in_map(time_ns, actors.names, actors.poses_at(time_ns)))

    every(_PERIOD_S, publish, wanted=lambda: transforms.has_subscribers)
    for actor in actors.actors:
        if isinstance(actor.motion, GivenMotion):
            topic = f"/actors/{actor.name}/pose"
            graph.subscribe(topic, _placing(graph, world, actor.name), PoseStamped)


def _placing(graph: Graph, world: SimulationWorld, name: str) -> Callable[[Published], None]:
    def receive(published: Published) -> None:
        message: Any = published.message
        if (frame := frame_of(message)) not in ("", "map"):
            graph.refuse(published.topic, f"poses are in 'map', not in '{frame}'")
            return
        position, turn = message.pose.position, message.pose.orientation
        attitude = [turn.x, turn.y, turn.z, turn.w]
        try:
            world.set_actor_pose(
                name,
                [position.x, position.y, position.z],
                attitude if any(attitude) else None,
            )
        except CommandError as error:
            graph.refuse(published.topic, str(error))

    return receive
