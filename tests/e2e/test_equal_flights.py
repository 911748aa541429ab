"""A flight is the same to the byte whether code reads, waits and commands in batches or not."""

import asyncio

from volery.engine.events import EventKind

SECONDS = 8.0


def flown(simulate, data, fly):
    simulation = simulate(data)
    simulation.diagnostics.enable_digest()
    fly(simulation)
    simulation.run(SECONDS - simulation.time_s)
    return simulation.diagnostics.digest()


def without(simulation):
    simulation.run(SECONDS)


def waits_for_conditions(simulation):
    simulation.run_until(lambda: simulation.time_s >= 0.123)
    futures = [uav.pending_command for uav in simulation.uavs.values()]
    simulation.run_until(lambda: simulation.uavs["uav1"].position_map[2] > 1.0)
    simulation.run_until([future for future in futures if future is not None])
    simulation.run_until(EventKind.MODE, timeout_s=3.0) if simulation.time_s < 2.0 else None


def reads_samples(simulation):
    sensors = simulation.uavs["uav1"].sensors
    for scan in sensors["horizontal"].samples(seconds=2.0):
        assert scan.points_base().shape[1] == 3
        assert sensors["imu"].has_sample
    stream = sensors["imu"].samples(depth=3)
    simulation.run(0.5)
    assert len(stream.take()) == 3
    sensors["range"].next()


def awaits(simulation):
    async def fly():
        task = asyncio.create_task(simulation.run_async(3.0))
        future = simulation.uavs["uav2"].pending_command
        if future is not None:
            future.add_done_callback(lambda _: None)
        await task

    asyncio.run(fly())


def test_reading_and_waiting_change_no_byte(simulate, wood_data):
    reference = flown(simulate, wood_data, without)
    assert flown(simulate, wood_data, waits_for_conditions) == reference
    assert flown(simulate, wood_data, reads_samples) == reference
    assert flown(simulate, wood_data, awaits) == reference


def test_waiting_for_a_command_equals_running_for_its_time(simulate, flat_data):
    def waits(simulation):
        uav = simulation.uavs["uav1"]
        times.append(uav.take_off(2.0).wait().time_ns)
        uav.go_to([2.0, 1.0, 2.5]).wait()
        times.append(simulation.time_ns)
        uav.hold().wait()
        times.append(simulation.time_ns)

    def runs(simulation):
        uav = simulation.uavs["uav1"]
        commands = (lambda: uav.take_off(2.0), lambda: uav.go_to([2.0, 1.0, 2.5]), uav.hold)
        for command, time_ns in zip(commands, times, strict=True):
            command()
            simulation.step((time_ns - simulation.time_ns) // 1_000_000)

    times = []
    assert flown(simulate, flat_data, waits) == flown(simulate, flat_data, runs)
