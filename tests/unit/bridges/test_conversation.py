"""Turns of the clients of one loop."""

import asyncio

import pytest

from volery.bridges.rosbridge.conversation import Turns


@pytest.mark.parametrize(("cost_s", "frames_a_turn"), [(1.0, 1), (1e-4, 3)])
def test_others_have_their_turn_by_cost(cost_s, frames_a_turn):
    order = []

    async def client(name):
        turns = Turns()
        for _ in range(6):
            order.append(name)
            await turns.spend(cost_s)

    async def both():
        await asyncio.gather(client("a"), client("b"))

    asyncio.run(both())
    assert "".join(order) == ("a" * frames_a_turn + "b" * frames_a_turn) * (6 // frames_a_turn)
