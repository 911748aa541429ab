"""Completion of flight commands: done, failed and why, in every way of waiting."""

import asyncio
import threading

import pytest

from volery.control.flight_modes import FlightMode
from volery.control.trajectory import Trajectory
from volery.core.errors import CommandError, FlightError, WaitTimeoutError
from volery.engine.events import EventKind
from volery.runtime import VectorizedSimulation
from volery.scenario.load import parse_scenario


@pytest.fixture
def flying(simulate, flat_data):
    """A simulation whose UAV has taken off."""
    simulation = simulate(flat_data)
    simulation.uavs["uav1"].take_off(2.0).wait()
    return simulation


def test_each_flight_mode_is_done_in_its_final_mode(simulate, flat_data):
    simulation = simulate(flat_data)
    uav = simulation.uavs["uav1"]
    assert uav.pending_command is None
    assert uav.wait() is None
    start = uav.position_map
    result = uav.take_off(2.0).wait()
    assert result.mode is uav.mode is FlightMode.HOLD
    assert result.time_ns == simulation.time_ns  # stops at the event, not later
    assert abs(result.position_map[2] - start[2] - 2.0) < 0.3
    uav.go_to([2.0, 0.0, 2.0]).wait()
    assert abs(uav.position_map[0] - 2.0) < 0.3
    uav.command_velocity([1.0, 0.0, 0.0])
    simulation.run(0.3)
    uav.hold().wait()
    assert abs(uav.velocity_map[0]) < 0.4
    trajectory = Trajectory.from_samples([0.0, 2.0], [uav.position_map, [4.0, 0.0, 2.0]])
    uav.follow_trajectory(trajectory).wait()
    assert uav.mode is FlightMode.HOLD
    assert uav.return_home().wait().mode is FlightMode.LANDED
    uav.take_off(1.0).wait()
    assert uav.land().wait().mode is FlightMode.LANDED


def test_a_run_settles_futures_and_calls_back(flying):
    uav = flying.uavs["uav1"]
    called = []
    future = uav.go_to([1.0, 0.0, 2.0])
    future.add_done_callback(lambda done: called.append((done, flying.time_ns)))
    assert not future.done()
    assert not future.cancelled()
    assert uav.pending_command is future
    with pytest.raises(CommandError, match=r"go_to of uav1 is not done: GO_TO at .*call wait"):
        future.result()
    flying.run(10.0)
    assert future.done()
    assert called == [(future, future.result().time_ns)]
    future.add_done_callback(called.append)
    assert called[-1] is future
    assert "is done at" in repr(future)


def test_the_end_does_not_depend_on_how_the_run_is_divided(simulate, flat_data):
    times = []
    for pieces in (None, 0.0137, 0.5):
        simulation = simulate(flat_data)
        future = simulation.uavs["uav1"].take_off(2.0)
        while pieces and not future.done():
            simulation.run(pieces)
        times.append(future.wait().time_ns)
        simulation.run_until(lambda at=simulation: at.time_s >= 4.0)
        future = simulation.uavs["uav1"].go_to([3.0, 0.0, 2.0])
        simulation.run_until(lambda at=simulation: at.uavs["uav1"].position_map[0] > 0.5)
        times.append(simulation.time_ns)
        while pieces and not future.done():
            simulation.run(pieces)
        times.append(future.wait().time_ns)
    assert times[:3] * 3 == times


@pytest.mark.parametrize(
    ("command", "reason"),
    [
        (lambda uav: uav.land(), "land replaced it"),
        (lambda uav: uav.go_to([0.0, 5.0, 2.0]), "go_to replaced it"),
        (lambda uav: uav.command_velocity([0.0, 0.0, 0.0]), "command_velocity replaced it"),
        (lambda uav: uav.command_rates([0.0, 0.0, 0.0], 10.0), "command_rates replaced it"),
        (lambda uav: uav.stop_rotors(), "stop_rotors replaced it"),
    ],
)
def test_another_command_replaces_it(flying, command, reason):
    uav = flying.uavs["uav1"]
    future = uav.go_to([5.0, 0.0, 2.0])
    flying.run(0.2)
    command(uav)
    assert future.done()
    with pytest.raises(FlightError, match=rf"go_to of uav1 failed at \d+\.\d\d s: {reason}"):
        future.wait()
    assert reason in str(future.exception())


def test_a_rejected_command_leaves_the_present_one(flying):
    uav = flying.uavs["uav1"]
    future = uav.go_to([5.0, 0.0, 2.0])
    with pytest.raises(CommandError, match="cannot take off"):
        uav.take_off()
    with pytest.raises(CommandError, match="must be numbers"):
        uav.command_velocity("fast")
    assert not future.done()


def test_services_and_topics_replace_it_too(flying):
    future = flying.uavs["uav1"].go_to([5.0, 0.0, 2.0])
    response = flying.graph.call("/uav1/land")
    assert response.success
    assert "land replaced it" in str(future.exception())


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda s: s.reset(), "the simulation was reset"),
        (lambda s: s.restore(s.snapshot()), "another state was restored"),
        (lambda s: s.vehicles.reset("uav1"), "the UAV was reset"),
        (
            lambda s: s.vehicles.set_pose("uav1", [3.0, 3.0, 3.0], [0.0, 0.0, 0.0, 1.0]),
            "its flight mode changed to HOLD",
        ),
        (
            lambda s: (s.vehicles.spawn("two", "f450", [9.0, 9.0, 0.2]), s.vehicles.delete("uav1")),
            "the UAV was deleted",
        ),
    ],
)
def test_changes_of_the_simulation_end_it(flying, change, reason):
    future = flying.uavs["uav1"].go_to([5.0, 0.0, 2.0])
    change(flying)
    assert future.done()
    assert reason in str(future.exception())


def test_a_crash_fails_it_with_the_obstacle(flying):
    uav = flying.uavs["uav1"]
    future = uav.go_to([9.0, 0.0, 2.0])
    flying.vehicles.set_velocity("uav1", [0.0, 0.0, 0.0], [0.0, 0.0, 0.0])
    future = uav.go_to([9.0, 0.0, 2.0])
    flying.faults.inject({"kind": "motor", "uav": "uav1", "rotor": 0, "thrust_factor": 0.0})
    flying.faults.inject({"kind": "motor", "uav": "uav1", "rotor": 1, "thrust_factor": 0.0})
    with pytest.raises(FlightError, match=r"failed at .* s: it hit ground at \d.* and crashed"):
        future.wait()
    assert uav.crashed
    with pytest.raises(CommandError, match="uav1 has crashed: there is nothing to wait for"):
        uav.wait()
    with pytest.raises(CommandError, match="all UAVs have crashed"):
        flying.vehicles.wait()


def test_a_closed_simulation_takes_no_commands(flying):
    pending = flying.uavs["uav1"].go_to([9.0, 0.0, 2.0])
    flying.close()
    with pytest.raises(FlightError, match="the simulation was closed"):
        pending.wait()
    with pytest.raises(CommandError, match="the simulation is closed; make a new one"):
        flying.uavs["uav1"].go_to([1.0, 0.0, 2.0])


def test_positions_are_no_trajectory(flying):
    with pytest.raises(CommandError, match=r"needed, not list; Trajectory.from_samples makes one"):
        flying.uavs["uav1"].follow_trajectory([[0.0, 0.0, 3.0], [1.0, 0.0, 3.0]])


def test_timeouts(flying):
    future = flying.uavs["uav1"].go_to([9.0, 0.0, 2.0])
    before = flying.time_s
    with pytest.raises(
        WaitTimeoutError, match=r"go_to of uav1 is not done within 0.5 s; it goes on: GO_TO at "
    ):
        future.wait(timeout_s=0.5)
    assert flying.time_s == pytest.approx(before + 0.5)
    assert not future.done()
    with pytest.raises(CommandError, match="timeout_s must be a number"):
        future.wait(timeout_s=-1.0)


def test_run_until_conditions_events_and_several_commands(simulate, flat_data):
    flat_data["uavs"][0]["count"] = 2
    simulation = simulate(flat_data)
    simulation.run(0.0035)
    checked = []

    def is_late():
        checked.append(simulation.time_ns)
        return simulation.time_s > 0.052

    assert simulation.run_until(is_late) is None
    assert simulation.time_ns == 60_000_000  # multiples of the period since time 0
    assert checked == [3_000_000, *range(10_000_000, 70_000_000, 10_000_000)]
    simulation.run_until(simulation.vehicles.take_off(1.0))
    assert {uav.mode for uav in simulation.uavs.values()} == {FlightMode.HOLD}
    simulation.vehicles.land()
    event = simulation.run_until("touch_down")
    assert event.kind is EventKind.TOUCH_DOWN
    assert event.time_ns == simulation.time_ns
    with pytest.raises(WaitTimeoutError, match=r"event 'collision' did not happen within 0.1 s"):
        simulation.run_until(EventKind.COLLISION, 0.1)
    with pytest.raises(WaitTimeoutError, match=r"the condition did not happen within 0.1 s"):
        simulation.run_until(lambda: False, 0.1)
    for wrong, reason in (("boom", "no event 'boom'"), (3, "takes a function"), ([1], "takes a")):
        with pytest.raises(CommandError, match=reason):
            simulation.run_until(wrong)
    with pytest.raises(CommandError, match="check_period_s must be above 0"):
        simulation.run_until(lambda: True, check_period_s=0.0)
    simulation.close()
    with pytest.raises(CommandError, match="closed"):
        simulation.run_until(lambda: True)


def test_one_failure_of_several_ends_the_wait(simulate, flat_data):
    flat_data["uavs"][0]["count"] = 2
    simulation = simulate(flat_data)
    futures = simulation.vehicles.take_off(3.0)
    simulation.uavs["uav2"].stop_rotors()
    with pytest.raises(FlightError, match=r"take_off of uav2 .* stop_rotors replaced it"):
        simulation.run_until(futures)


def test_within_a_tick_nothing_waits_but_callbacks_work(flying):
    uav = flying.uavs["uav1"]
    seen = []

    def on_timer():
        future = uav.go_to([1.0, 0.0, 2.0])
        with pytest.raises(CommandError, match=r"advancing already.*add_done_callback"):
            future.wait()
        with pytest.raises(CommandError, match="advancing already"):
            flying.run_until(future)
        future.add_done_callback(seen.append)

    flying.post(lambda: flying._engine.at(flying.time_ns + 1_000_000, on_timer))
    flying.run(8.0)
    assert [future.command for future in seen] == ["go_to"]


def test_another_thread_waits_for_the_run(flying):
    uav = flying.uavs["uav1"]
    results = []

    def wait():
        future = flying.post(lambda: uav.go_to([1.0, 0.0, 2.0])).result()
        results.append(future.wait())

    thread = threading.Thread(target=wait)
    thread.start()
    while thread.is_alive():
        flying.run(0.1, speed=20.0)
    assert results[0].mode is FlightMode.HOLD


def test_a_thread_sees_the_run_of_another_one_that_is_paused_or_has_ended(flying):
    uav = flying.uavs["uav1"]
    future = uav.go_to([1.0, 0.0, 2.0])
    flying.clock.pause()
    runner = threading.Thread(target=lambda: flying.run(10.0, speed=50.0))
    runner.start()
    with pytest.raises(WaitTimeoutError, match="within 0 s"):
        future.wait(timeout_s=0.0)  # does not advance the simulation of the other thread
    assert not future.done()
    flying.clock.resume()
    assert future.wait().mode is FlightMode.HOLD
    runner.join()
    assert uav.land().wait().mode is FlightMode.LANDED  # its thread has ended: this one advances it


def test_a_run_that_quits_or_closes_ends_the_wait(flying):
    uav = flying.uavs["uav1"]
    future = uav.go_to([9.0, 0.0, 2.0])
    flying.post(lambda: flying._engine.at(flying.time_ns + 100_000_000, flying.clock.quit))
    with pytest.raises(CommandError, match=r"the run was quit at \d+\.\d\d s"):
        future.wait()
    with pytest.raises(CommandError, match="the run was quit"):
        flying.run_until(future)
    flying.close()
    assert "the simulation was closed" in str(future.exception())


def test_callbacks_command_the_next_mode(flying):
    uav, futures = flying.uavs["uav1"], []
    uav.go_to([1.0, 0.0, 2.0]).add_done_callback(lambda _: futures.append(uav.land()))
    flying.run_until("touch_down")
    assert futures[0].wait().mode is FlightMode.LANDED


def test_await_beside_run_async(flying):
    uav = flying.uavs["uav1"]

    async def fly():
        task = asyncio.create_task(flying.run_async())
        await asyncio.sleep(0)
        with pytest.raises(CommandError, match="await"):
            uav.hold().wait()
        result = await uav.go_to([1.0, 0.0, 2.0])
        future = uav.go_to([3.0, 0.0, 2.0])
        uav.land()
        with pytest.raises(FlightError, match="land replaced it"):
            await future
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task
        assert await flying.run_until_async("touch_down") is not None
        await flying.run_async(0.25)
        return result

    assert asyncio.run(fly()).mode is FlightMode.HOLD
    assert flying.time_ns > 0
    flying.run(0.1)  # the simulation is free again


def test_await_alone_advances_the_simulation(simulate, flat_data):
    flat_data["uavs"][0]["count"] = 2
    simulation = simulate(flat_data)
    first, second = simulation.uavs.values()

    async def fly():
        await first.take_off(2.0)
        results = await asyncio.gather(first.go_to([2.0, 0.0, 2.0]), second.take_off(1.0))
        assert {result.mode for result in results} == {FlightMode.HOLD}
        task = asyncio.create_task(simulation.run_async(speed=50.0))
        await first.land()  # the task has begun before: it advances the simulation
        assert not task.done()
        task.cancel()

    asyncio.run(fly())
    future = second.go_to([9.0, 0.0, 2.0])
    simulation.clock.quit()

    async def wait():
        await future

    with pytest.raises(CommandError, match="the run was quit"):
        asyncio.run(wait())


def test_await_waits_for_the_run_of_another_thread(flying):
    future = flying.uavs["uav1"].go_to([1.0, 0.0, 2.0])
    runner = threading.Thread(target=lambda: flying.run(5.0, speed=20.0))

    async def wait():
        runner.start()
        return await future

    assert asyncio.run(wait()).mode is FlightMode.HOLD
    runner.join()


def test_environments_wait_for_one_uav(flat_data):
    flat_data["uavs"][0]["on_start"] = "take_off"
    with VectorizedSimulation(parse_scenario(flat_data), 3, threads=2) as envs:
        uav = envs.uav(2, "uav1")
        assert uav.wait().mode is FlightMode.HOLD
        future = uav.go_to([3.0, 0.0, 3.0])
        envs.reset([2])
        assert "go_to of 2/uav1 failed" in str(future.exception())
        assert "the environment was reset" in str(future.exception())
        for done in envs.hold():
            done.wait()
        with pytest.raises(CommandError, match="timeout_s must be a number"):
            envs.uav(1, "uav1").land().wait(timeout_s=-1.0)
        refused = []

        def wait(landed):
            with pytest.raises(CommandError, match="advancing already"):
                envs.uav(1, "uav1").take_off().wait()
            refused.append(landed.result().mode)

        envs.uav(1, "uav1").pending_command.add_done_callback(wait)
        envs.run(15.0)
        assert refused == [FlightMode.LANDED]

        async def climb():
            return await envs.uav(2, "uav1").go_to([0.0, 0.0, 4.0])

        assert asyncio.run(climb()).mode is FlightMode.HOLD
        assert envs.uav(0, "uav1").mode is FlightMode.HOLD
