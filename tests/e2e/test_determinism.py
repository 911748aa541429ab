"""Same scenario and seed, same bytes: at any speed, however sliced, with one or two threads."""

import pytest

from volery.core.errors import CommandError

SECONDS = 6.0


def digest_of(simulate, data, *, threads=1, fly=None):
    simulation = simulate(data, threads=threads)
    simulation.diagnostics.enable_digest()
    (fly or (lambda s: s.run(SECONDS)))(simulation)
    assert simulation.time_s == pytest.approx(SECONDS)
    assert any(name.endswith("scan") for name in simulation.vehicles.lidar_mounts)
    return simulation.diagnostics.digest()


def slices(simulation):
    for seconds in (0.001, 0.0185, 0.5, 0.0005, 1.0):
        simulation.run(seconds)
    while simulation.time_s < SECONDS:
        simulation.step(min(37, round((SECONDS - simulation.time_s) * 1000)))


def test_threads_slices_and_speed_do_not_matter(simulate, wood_data):
    reference = digest_of(simulate, wood_data)
    assert digest_of(simulate, wood_data) == reference
    assert digest_of(simulate, wood_data, threads=2) == reference
    assert digest_of(simulate, wood_data, fly=slices) == reference
    assert digest_of(simulate, wood_data, fly=lambda s: s.run(SECONDS, speed=20.0)) == reference


def test_another_seed_gives_another_run(simulate, flat_data):
    flat_data["uavs"][0]["on_start"] = "take_off"
    digests = []
    for seed in (1, 2):
        simulation = simulate({**flat_data, "seed": seed})
        simulation.diagnostics.enable_digest()
        simulation.run(1.0)
        digests.append(simulation.diagnostics.digest())
    assert digests[0] != digests[1]


def test_an_added_uav_changes_no_other_uavs_noise(simulate, flat_data):
    def imu_of_first(count):
        flat_data["uavs"][0]["count"] = count
        simulation = simulate(flat_data)
        got = []
        simulation.graph.subscribe("/uav1/imu", lambda m: got.append(m.cdr))
        simulation.run(0.5)
        return got

    assert imu_of_first(1) == imu_of_first(3)
    assert len(imu_of_first(1)) == 101


def test_digest_must_be_asked_for(simulate, flat_data):
    with pytest.raises(CommandError, match="enable_digest"):
        simulate(flat_data).diagnostics.digest()


BARE = {
    "name": "bare",
    "duration_s": 60.0,
    "ends_when": "all_landed",
    "types": {"f450": {"flight": {"take_off_altitude_m": 1.0}}},
    "uavs": [
        {"type": "f450", "position_m": [0.0, 0.0], "on_start": "take_off"},
        {"type": "f450", "position_m": [3.0, 0.0], "on_start": "take_off"},
        {"type": "f450", "position_m": [9.0, 0.0, 3.0]},
    ],
}


def land_all(simulation):
    for name in ("uav1", "uav2"):
        simulation.uavs[name].land()


@pytest.mark.parametrize("piece", [0.001, 0.004, 0.1])
def test_events_without_sensors_do_not_depend_on_slices(simulate, piece):
    """Nothing but events ends a tick here: take-offs, landings and a fall."""

    def fly(size):
        simulation = simulate(BARE)
        simulation.diagnostics.enable_digest()
        simulation.uavs["uav3"].command_rotor_speeds([0.0] * 4)
        while simulation.time_ns < 4_000_000_000:
            simulation.run(size)
        land_all(simulation)
        while simulation.time_ns < 9_000_000_000:
            simulation.run(size)
        assert len(simulation.diagnostics.events) >= 6
        return simulation.diagnostics.digest()

    assert fly(piece) == fly(0.5)


def test_the_end_of_a_run_does_not_depend_on_speed(simulate):
    def end(speed, first=0.0):
        simulation = simulate(BARE)
        simulation.diagnostics.enable_digest()
        simulation.uavs["uav3"].command_rotor_speeds([0.0] * 4)
        simulation.run(first)
        simulation.run(3.0 - first)
        land_all(simulation)
        simulation.run(speed=speed)
        assert simulation.clock.finished
        return simulation.time_ns, simulation.diagnostics.digest()

    assert end(None) == end(7.0) == end(31.0, first=0.03)


def test_parts_of_steps_are_owed(simulate, flat_data):
    simulation = simulate(flat_data)
    for _ in range(10):
        simulation.run(0.0004)
    assert simulation.time_ns == 4_000_000
