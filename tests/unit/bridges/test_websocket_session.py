"""Turns of the clients of one loop."""

import asyncio

from volery.bridges.rosbridge.bulk_turns import TURNS_A_ROUND, BulkTurns, Writer


def test_clients_with_much_to_send_take_turns_and_others_have_theirs_between():
    sent = []

    async def client(bulk, name):
        while True:
            await bulk.turn()
            sent.append(name)

    async def scene():
        bulk = BulkTurns()
        tasks = [asyncio.create_task(client(bulk, name)) for name in range(3 * TURNS_A_ROUND)]
        tasks[0].cancel()  # before its turn has come
        await asyncio.sleep(0)
        rounds = []
        for _ in range(9):
            before = len(sent)
            await asyncio.sleep(0)  # as a client with little to send waits
            rounds.append(len(sent) - before)
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
        assert max(rounds) <= TURNS_A_ROUND
        counts = [sent.count(name) for name in range(1, 3 * TURNS_A_ROUND)]
        assert min(counts) >= 1
        assert max(counts) - min(counts) <= 1
        assert 0 not in sent

    asyncio.run(scene())


def test_clients_that_cost_more_than_their_share_wait_in_line():
    now_s = [0.0]
    bulk = BulkTurns(lambda: now_s[0])
    lines = []

    async def turn():
        lines[-1] += 1

    bulk.turn = turn

    async def write(cost_s):
        writer = Writer(bulk)
        lines.append(0)
        for _ in range(100):
            now_s[0] += 0.001
            await writer.begin()
            await writer.spend(cost_s)
        return writer

    async def scene():
        alone = await write(2e-4)  # a fifth of the time, of the half that it has alone
        others = [Writer(bulk) for _ in range(3)]
        busy = await write(2e-4)  # of the tenth that each of five has
        modest = await write(1e-5)
        for writer in (alone, busy, modest, *others):
            writer.close()

    asyncio.run(scene())
    assert lines[0] == 0
    assert lines[1] > 50
    assert lines[2] == 0
    assert bulk.num_clients == 0
