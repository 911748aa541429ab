"""Things that move, on the graph: where they are, and where something outside puts them."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from volery.core.errors import CommandError
from volery.graph.messages import (
    PoseStamped,
    Published,
    Quaternion,
    TFMessage,
    Transform,
    TransformStamped,
    Vector3,
    header,
)
from volery.world.actors import MovingActors
from volery.world.actors.motions import GivenMotion

if TYPE_CHECKING:
    from volery.runtime.simulation import Simulation

_PERIOD_S = 0.02


def offer_actors(simulation: Simulation, actors: MovingActors, every: Callable[..., None]) -> None:
    """Tell of all things on `/tf`, 50 times a second; listen to `/actors/NAME/pose`.

    A pose in the map that comes there is that of the thing from now on; a rotation of zeros keeps
    its heading. What is none, or for a thing that goes its own way, is ignored: there is nobody to
    tell.
    """
    graph = simulation.graph
    transforms = graph.advertise("/tf", TFMessage)

    def tell() -> None:
        stamp = header(simulation.time_ns, "map")
        poses = actors.poses_at(simulation.time_ns).tolist()
        transforms.publish(
            TFMessage(
                [
                    TransformStamped(
                        stamp, name, Transform(Vector3(*pose[:3]), Quaternion(*pose[3:]))
                    )
                    for name, pose in zip(actors.names, poses, strict=True)
                ]
            )
        )

    every(_PERIOD_S, tell, wanted=lambda: transforms.wanted)
    for actor in actors.actors:
        if isinstance(actor.motion, GivenMotion):
            topic = f"/actors/{actor.name}/pose"
            graph.subscribe(topic, _placing(simulation, actor.name), PoseStamped)


def _placing(simulation: Simulation, name: str) -> Callable[[Published], None]:
    def receive(published: Published) -> None:
        message: Any = published.message
        if message.header.frame_id not in ("", "map"):
            return
        place, turn = message.pose.position, message.pose.orientation
        attitude = [turn.x, turn.y, turn.z, turn.w]
        try:
            simulation.set_actor_pose(
                name,
                [place.x, place.y, place.z],
                attitude if any(attitude) else None,
            )
        except CommandError:
            return

    return receive
