"""What clients cost the simulation's thread: questions are cheap, and the rest waits its turn."""

from __future__ import annotations

import time

import pytest
from whole_world import Client

from volery.engine.call_budget import MAX_FRACTION
from volery.graph.messages import String
from volery.runtime.services import scenario_loading
from volery.scenario import load
from volery.scenario.catalog import ScenarioCatalog
from volery.server.access_policy import READ_ONLY_SERVICES


@pytest.fixture
def client(simulate, flat_data):
    return Client(simulate(flat_data))


def test_choices_are_made_out_once(client, monkeypatch):
    client.call("/volery/get_scenario_options", None)

    def forbidden(*_args, **_options):
        raise AssertionError("built again")

    monkeypatch.setattr(scenario_loading.Changes, "model_json_schema", forbidden)
    monkeypatch.setattr(scenario_loading, "describe", forbidden)
    assert client.call("/volery/get_scenario_options", None).success


def test_worlds_are_read_once(simulate, flat_data, tmp_path, monkeypatch):
    folder = tmp_path / "scenarios" / "mine"
    folder.mkdir(parents=True)
    text = '[types.f450]\n[[uavs]]\ntype = "f450"\nposition_m = [0, 0]\n'
    (folder / "scenario.toml").write_text(f'name = "mine"\n{text}')
    catalog = ScenarioCatalog(tmp_path / "scenarios")
    client = Client(simulate(flat_data, shelf=catalog))
    worlds = client.call("/get_available_worlds", None).worlds
    assert "mine" in [world.name for world in worlds]
    monkeypatch.setattr("volery.scenario.catalog.load_scenario", lambda *_, **__: 1 / 0)
    assert len(client.call("/get_available_worlds", None).worlds) == len(worlds)
    monkeypatch.setattr("volery.scenario.catalog.load_scenario", load.load_scenario)
    (folder / "scenario.toml").write_text(f'name = "mine"\ndescription = "new"\n{text}')
    worlds = client.call("/get_available_worlds", None).worlds
    assert "new" in [world.description for world in worlds]


def test_lists_of_entities_make_no_shapes(client, monkeypatch):
    """Half a millisecond for each UAV."""
    monkeypatch.setattr("volery.runtime.services.entity_views.body_shape", lambda _: 1 / 0)
    assert client.call("/get_entities", None).entities == ["uav1"]
    assert len(client.call("/get_entities_states", None).states) == 1


def test_read_only_services_cost_little(client):
    """The fastest of some calls, in CPU time of a loop that takes 2 ms: slow ones took 30 ms."""

    def cpu_s(work):
        before = time.thread_time()
        work()
        return time.thread_time() - before

    unit = min(cpu_s(lambda: sum(k * k for k in range(40_000))) for _ in range(10))
    for service in sorted(READ_ONLY_SERVICES):
        if not client.simulation.graph.has_service(service):
            continue
        costs = [cpu_s(lambda service=service: client.call(service, None)) for _ in range(4)]
        assert min(costs) < 10.0 * unit, service


def test_a_loop_of_calls_is_deferred_in_order_and_others_are_not(client):
    """At full speed, with services that cost 2 ms of CPU time each."""
    simulation, taken = client.simulation, []
    before_s, cpu_s = time.perf_counter(), time.thread_time()

    def burn(published):
        until = time.thread_time() + 0.002
        while time.thread_time() < until:
            pass
        taken.append(published.message.data)

    simulation.graph.subscribe("/burn", burn, String)
    client.session.advertise("/burn", String.__msgtype__)
    for number in range(2_000):
        client.session.publish("/burn", String(str(number)))
    other = Client(simulation, "other")
    other.session.advertise("/other", String.__msgtype__)
    received = []
    simulation.graph.subscribe("/other", received.append, String)
    simulation.step(200)
    other.session.publish("/other", String("x"))
    simulation.step(1)
    assert received
    spent_s = 0.002 * len(taken)
    wall_s = max(time.perf_counter() - before_s, time.thread_time() - cpu_s)
    assert spent_s <= MAX_FRACTION * wall_s + 0.2
    assert taken == [str(number) for number in range(len(taken))]
    assert client.session.waiting == 2_000 - len(taken) + 0
    simulation.process_commands()
    assert len(taken) == 2_000
    assert client.session.waiting == 0


def test_a_deferred_command_is_recorded_when_it_is_taken(client):
    simulation, moments = client.simulation, []
    note = simulation.commands.note

    def watch(taken, weight):
        moments.append(simulation._engine.moment.step)
        note(taken, weight)

    simulation.commands.note = watch
    simulation.graph.subscribe("/burn", lambda _: time.sleep(0), String)
    client.session.advertise("/burn", String.__msgtype__)
    for _ in range(3_000):
        client.session.publish("/burn", String("x" * 10))
    simulation.step(50)
    simulation.process_commands()
    assert len(moments) == 3_001
    assert moments == sorted(moments)
