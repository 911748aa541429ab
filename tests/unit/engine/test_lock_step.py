"""Tests lock-step partners: external programs that the simulation waits for."""

import threading
import time

import pytest

from volery.core.errors import CommandError, PartnerError, SnapshotError

MS = 1_000_000


def in_thread(function):
    thread = threading.Thread(target=function, daemon=True)
    thread.start()
    return thread


def operator(partner, uav, times, pause_s=0.0):
    """Fly by a law of time alone, from another thread."""

    def work():
        while (time_ns := partner.wait(60.0)) is not None:
            time.sleep(pause_s)
            times.append(time_ns)
            speed = 1.0 if (time_ns // (200 * MS)) % 2 else -1.0
            partner.reply(lambda speed=speed: uav.command_velocity([speed, 0.0, 0.2]))

    return in_thread(work)


def airborne(simulate, data):
    data["uavs"][0]["position_m"] = [0.0, 0.0, 5.0]
    return simulate(data)


def test_engine_waits_and_obeys_in_time(simulate, flat_data):
    digests = set()
    for pause_s, slices in ((0.0, [1.0]), (0.003, [0.0401] * 24 + [0.0376])):
        simulation = airborne(simulate, flat_data)
        simulation.diagnostics.enable_digest()
        times = []
        partner = simulation.clock.add_partner("operator", period_s=0.05)
        thread = operator(partner, simulation.uavs["uav1"], times, pause_s)
        for seconds in slices:
            simulation.run(seconds)
        digests.add(simulation.diagnostics.digest())
        simulation.close()
        thread.join(60.0)
        assert not thread.is_alive()
        assert times == [50 * MS * k for k in range(1, 21)]
    assert len(digests) == 1


def test_partners_work_side_by_side_and_speak_in_order(simulate, flat_data):
    simulation = airborne(simulate, flat_data)
    said = []
    both = threading.Barrier(2)
    partners = [simulation.clock.add_partner(n, period_s=0.01, timeout_s=20.0) for n in ("a", "b")]

    def work(partner):
        while partner.wait(60.0) is not None:
            both.wait(60.0)  # breaks unless both are waited for at once
            partner.reply(lambda: said.append(partner.name))

    for partner in partners:
        in_thread(lambda partner=partner: work(partner))
    simulation.run(0.05)
    assert said == ["a", "b"] * 5


def test_silent_partner_ends_the_run(simulate, flat_data):
    simulation = airborne(simulate, flat_data)
    simulation.clock.add_partner("px4", period_s=0.01, timeout_s=0.05)
    with pytest.raises(PartnerError, match=r"'px4' did not answer within 0\.05 s .* at 0\.010 s"):
        simulation.run(0.1)


def test_silent_partner_is_left_behind_where_agreed(simulate, flat_data):
    simulation = airborne(simulate, flat_data)
    partner = simulation.clock.add_partner("px4", period_s=0.01, timeout_s=0.05, on_timeout="leave")
    simulation.run(0.1)
    assert partner.has_left
    assert partner.wait(1.0) is None


def test_leaving_lets_the_run_go_on(simulate, flat_data):
    simulation = airborne(simulate, flat_data)
    partner = simulation.clock.add_partner("guest", period_s=0.01, timeout_s=20.0)

    def work():
        partner.wait(60.0)
        partner.leave()

    thread = in_thread(work)
    simulation.run(0.1)
    thread.join(60.0)
    assert simulation.time_ns == 100 * MS
    simulation.snapshot()


def test_speaking_out_of_turn_is_refused(simulate, flat_data):
    simulation = airborne(simulate, flat_data)
    partner = simulation.clock.add_partner("guest", period_s=0.01)
    with pytest.raises(PartnerError, match="no barrier to reply to"):
        partner.reply()
    with pytest.raises(PartnerError, match=r"no barrier within 0\.01 s"):
        partner.wait(0.01)


def test_states_are_not_kept_while_a_partner_takes_part(simulate, flat_data):
    simulation = airborne(simulate, flat_data)
    simulation.clock.add_partner("px4", period_s=0.01)
    with pytest.raises(SnapshotError, match="partner 'px4' is external"):
        simulation.snapshot()


@pytest.mark.parametrize("values", [{"period_s": 0.0}, {"period_s": 1.0, "timeout_s": -1.0}])
def test_impossible_terms_are_refused(simulate, flat_data, values):
    with pytest.raises(CommandError, match="finite and positive"):
        airborne(simulate, flat_data).clock.add_partner("guest", **values)


def test_partners_that_begin_anew_come_along_in_a_reset(simulate, flat_data):
    simulation = airborne(simulate, flat_data)
    times = []
    partner = simulation.clock.add_partner("operator", period_s=0.02, supports_reset=True)
    operator(partner, simulation.uavs["uav1"], times)
    simulation.run(0.05)
    with pytest.raises(SnapshotError, match="partner 'operator' is external"):
        simulation.snapshot()
    simulation.reset()
    simulation.run(0.05)
    assert times == [20 * MS, 40 * MS] * 2
