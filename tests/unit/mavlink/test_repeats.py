"""Flights by MAVLink are results like any others: repeated, kept, restored."""

import numpy as np
from flying_bench import Station, fly, scenario

from volery.bridges.logs.log_writer import create_log
from volery.bridges.logs.recorded_flight import read_flight
from volery.mavlink.scenario_setup import NODE, with_autopilots
from volery.runtime import Simulation
from volery.runtime.replay.scenario_record import scenario_of


def offboard_flight(simulation, station):
    station.seconds(0.1)
    station.up(2.0)
    station.stream(0.4, station.velocity, 1.0, 0.5, 0.0)
    assert station.mode(6) == 0
    station.stream(1.0, station.velocity, 1.0, 0.5, 0.0)
    station.seconds(1.5)  # and is lost
    return simulation.diagnostics.digest()


def test_a_flight_in_pieces_is_the_flight_in_one():
    digests = []
    for seconds in (
        lambda s, t: s.run(t),
        lambda s, t: [s.step(7) for _ in range(round(t / 0.007))],
    ):
        simulation = Simulation(scenario(), threads=1)
        with simulation:
            simulation.diagnostics.enable_digest()
            station = Station(simulation)
            seconds(simulation, 0.14)
            station.command(400, 1.0)
            station.command(22)
            seconds(simulation, 3.5)
            digests.append(simulation.diagnostics.digest())
    assert digests[0] == digests[1]


def test_a_snapshot_holds_what_the_autopilot_was_at():
    simulation, station = fly()
    with simulation:
        station.seconds(0.1)
        station.up(2.0)
        station.stream(0.4, station.velocity, 1.0, 0.5, 0.0)
        assert station.mode(6) == 0
        kept = simulation.snapshot()
        ends = []
        for _ in range(2):
            station.seconds(2.5)  # offboard is lost, it holds
            ends.append(simulation.uavs["uav1"].position_map)
            assert station.present_mode == (4, 3)
            simulation.restore(kept)
        assert np.array_equal(*ends)
        simulation.reset()
        station.seconds(1.2)
        assert not station.armed


def test_autopilots_are_part_of_what_is_flown():
    once = scenario()
    assert [entry.node for entry in once.types["iris"].nodes] == [NODE]
    assert with_autopilots(once) == once


def test_a_recorded_flight_is_repeated(tmp_path):
    path = tmp_path / "flight.mcap"
    simulation = Simulation(scenario(), threads=1)
    log = create_log(path)
    with simulation:
        simulation.diagnostics.enable_digest()
        simulation.graph.subscribe_all(log.write)
        gate = simulation.gateway.open("ground station")
        station = GatewayStation(simulation, gate)
        digest = offboard_flight(simulation, station)
        simulation.commands.end()
        log.close()
    flight = read_flight(path)
    again = Simulation(scenario_of(flight.origin), threads=1)
    with again:
        again.diagnostics.enable_digest()
        again.replay_commands(flight)
        again.run()
        assert again.diagnostics.digest() == digest


class GatewayStation(Station):
    """Sends as a bridge does: through a session, whose doings are logged."""

    def __init__(self, simulation, session):
        self._session = session
        session.advertise("/uav1/mavlink/in", "volery_interfaces/msg/MavlinkPackets")
        super().__init__(simulation)

    def send_bytes(self, data):
        from flying_bench import PACKETS

        from volery.graph.messages import message_type

        message = message_type(PACKETS)(
            link=self.link,
            profile=self.profile,
            closed=False,
            data=np.frombuffer(data, np.uint8),
        )
        self._session.publish("/uav1/mavlink/in", message)
        self.simulation.process_commands()
        self.simulation.graph.deliver()
