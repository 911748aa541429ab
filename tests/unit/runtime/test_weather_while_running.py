"""Rain, snow, fog, dust and hour: set at the start and in flight, published, saved, played back."""

import math

import numpy as np
import pytest
from service_calls import call_service

from volery.bridges.logs.replay import Replay
from volery.core.errors import ScenarioError
from volery.graph.codecs.zero import zero_message
from volery.graph.messages import Vector3, message_type
from volery.scenario.load import load_scenario, parse_scenario
from volery.world.weather import CLEAR_AIR, Particles

WET = {"rain_mm_h": 12.0, "fog_visibility_m": 150.0}


@pytest.fixture
def seeing_data(flat_data):
    """A hovering UAV with a LIDAR and a camera, on level ground."""
    flat_data["types"]["f450"]["sensors"] += [
        {"kind": "lidar", "name": "level", "model": "vlp_16", "position_m": [0.0, 0.0, 0.2]},
        {"kind": "camera", "width": 64, "height": 48, "position_m": [0.1, 0.0, 0.1]},
    ]
    flat_data["uavs"][0]["position_m"] = [0.0, 0.0, 5.0]
    return flat_data


def listen(simulation, topic):
    received = []
    simulation.graph.subscribe(topic, lambda published: received.append(published.message))
    return received


def test_a_scenario_has_weather_and_hour(simulate, flat_data):
    flat_data["world"] = {"weather": WET, "light": {"hour_of_day": 7.5, "date": "2025-03-20"}}
    weather = simulate(flat_data).world.weather
    assert weather.particles == Particles(rain_mm_h=12.0, fog_visibility_m=150.0)
    assert weather.hour_of_day == 7.5


@pytest.mark.parametrize(
    ("world", "words"),
    [
        ({"weather": {"rain_mm_h": -1.0}}, "rain_mm_h"),
        ({"weather": {"fog_visibility_m": 1.0}}, "fog_visibility_m"),
        ({"weather": {"hail_mm_h": 1.0}}, "hail_mm_h"),
        ({"light": {"hour_of_day": 25.0}}, "hour_of_day"),
        ({"light": {"hour_of_day": 9.0, "sun_elevation_deg": 10.0}}, "angles"),
    ],
)
def test_what_cannot_be_is_refused(flat_data, world, words):
    with pytest.raises(ScenarioError, match=words):
        parse_scenario({**flat_data, "world": world})


def test_services_set_some_fields_or_all(simulate, flat_data):
    simulation = simulate(flat_data)
    call_service(simulation, "/volery/set_weather", wind={"x": 3.0}, w20=5.0)
    some = call_service(
        simulation, "/volery/set_weather", only=["rain", "hour_of_day"], rain=8.0, hour_of_day=12.0
    )
    assert some.success
    assert simulation.world.weather.velocity_map == (3.0, 0.0, 0.0)
    response = call_service(simulation, "/volery/get_weather")
    assert (response.wind.x, response.w20, response.rain, response.snow, response.hour_of_day) == (
        3,
        5,
        8,
        0,
        12,
    )
    visibility = 1 / (1 / 20e3 + 1 / simulation.world.weather.particles.visibility_m)
    assert response.visibility == pytest.approx(visibility)
    assert response.sun_elevation == pytest.approx(math.radians(90 - 47.4 + 23.44), abs=0.005)
    assert response.sun_azimuth == pytest.approx(math.pi, abs=0.05)
    assert call_service(simulation, "/volery/set_weather", fog_visibility=80.0).success
    assert simulation.world.weather.particles == Particles(fog_visibility_m=80.0)
    assert simulation.world.weather.velocity_map == (0.0, 0.0, 0.0)
    assert simulation.world.weather.hour_of_day == 12.0
    assert call_service(simulation, "/volery/set_weather").success
    assert simulation.world.weather.particles == CLEAR_AIR


def test_services_refuse_what_cannot_be(simulate, flat_data):
    simulation = simulate(flat_data)
    for fields, word in (
        ({"rain": -1.0}, "rain_mm_h"),
        ({"snow": math.nan}, "snow_mm_h"),
        ({"fog_visibility": 1.0}, "fog_visibility_m"),
        ({"hour_of_day": 30.0}, "hour_of_day"),
        ({"only": ["hail"]}, "known: wind"),
    ):
        response = call_service(simulation, "/volery/set_weather", **fields)
        assert not response.success
        assert word in response.message
    assert simulation.world.weather.particles == CLEAR_AIR


def test_the_weather_is_published_at_once_and_at_each_change(simulate, flat_data):
    flat_data["world"] = {"weather": WET}
    simulation = simulate(flat_data)
    simulation.run(0.1)
    received = listen(simulation, "/weather")  # late: it is latched
    simulation.run(0.1)
    (first,) = received
    assert (first.rain, first.fog_visibility, first.profile) == (12.0, 150.0, "uniform")
    call_service(simulation, "/volery/set_weather", snow=2.0)
    call_service(simulation, "/volery/gust", amplitude={"x": 5.0}, rise=0.5)
    simulation.run(0.01)
    _, snowy, gusty = received
    assert (snowy.rain, snowy.snow, list(snowy.gusts)) == (0.0, 2.0, [])
    assert snowy.header.stamp.nanosec == 200_000_000
    (gust,) = gusty.gusts
    assert (gust.amplitude.x, gust.start, gust.rise, gust.end) == (5.0, 0.2, 0.5, 0.0)


def test_what_is_published_can_be_commanded(simulate, flat_data):
    """`/weather_command` accepts all of `/weather`, gusts included, and nothing that cannot be."""
    one, other = simulate(flat_data), simulate(flat_data)
    received = listen(one, "/weather")
    wet = {"rain": 5.0, "dust_visibility": 90.0, "hour_of_day": 24.0}
    call_service(one, "/volery/set_weather", wind={"y": 2.0}, **wet)
    call_service(one, "/volery/gust", amplitude={"x": 5.0}, rise=0.5, duration=3.0)
    one.run(0.01)
    command = other.graph.advertise("/weather_command", "volery_interfaces/msg/Weather")
    command.publish(received[-1])
    other.run(0.01)
    assert other.world.weather == one.world.weather
    broken = zero_message("volery_interfaces/msg/Weather")
    broken.rain = -1.0
    command.publish(broken)
    endless = zero_message("volery_interfaces/msg/Weather")
    still = Vector3(0.0, 0.0, 0.0)
    gust = message_type("volery_interfaces/msg/Gust")
    endless.gusts = [gust(Vector3(1e9, 0.0, 0.0), 0.0, 1.0, 0.0, still)]
    command.publish(endless)
    other.run(0.01)
    assert other.world.weather == one.world.weather


def test_a_recorded_weather_plays_back_exactly(simulate, seeing_data, tmp_path):
    """The same flight and measurements, from a log of the weather alone."""

    def flown(simulation):
        clouds = listen(simulation, "/uav1/points")
        images = listen(simulation, "/uav1/camera/image_raw")
        simulation.run(0.5)
        return clouds, images, simulation.uavs["uav1"].position_map

    first = simulate(seeing_data, recordings=tmp_path)
    call_service(first, "/volery/start_recording", path="weather.mcap")
    first.run(0.25)
    call_service(
        first, "/volery/set_weather", wind={"x": 6.0}, w20=8.0, fog_visibility=40.0, snow=2.0
    )
    clouds, images, position = flown(first)
    call_service(first, "/volery/stop_recording")

    again = simulate(seeing_data)
    again.replay_log(
        Replay(
            tmp_path / "weather.mcap", topics=("/weather",), remap={"/weather": "/weather_command"}
        )
    )
    again.run(0.25)
    clouds_again, images_again, position_again = flown(again)
    assert again.world.weather == first.world.weather
    np.testing.assert_array_equal(position_again, position)
    for one, other in ((clouds, clouds_again), (images, images_again)):
        assert len(one) >= 4
        assert [bytes(m.data) for m in one] == [bytes(m.data) for m in other]


def test_sensors_see_a_change_at_once_and_a_restore_takes_it_back(simulate, seeing_data):
    simulation = simulate(seeing_data)
    clouds = listen(simulation, "/uav1/points")
    images = listen(simulation, "/uav1/camera/image_raw")
    simulation.run(0.3)
    clear = simulation.snapshot()
    simulation.run(0.3)
    seen = [bytes(m.data) for m in clouds], [bytes(m.data) for m in images]
    simulation.restore(clear)
    call_service(simulation, "/volery/set_weather", fog_visibility=30.0)
    clouds.clear()
    images.clear()
    simulation.run(0.3)
    foggy = simulation.snapshot()
    hidden = [bytes(m.data) for m in clouds]
    assert all(a != b for a, b in zip(seen[0][-len(hidden) :], hidden, strict=True))
    assert np.asarray(images[-1].data).std() < 0.5 * np.frombuffer(seen[1][-1], np.uint8).std()
    simulation.restore(clear)
    assert simulation.world.weather.particles == CLEAR_AIR
    clouds.clear()
    images.clear()
    simulation.run(0.3)
    assert [bytes(m.data) for m in clouds] == seen[0][-len(clouds) :]
    assert [bytes(m.data) for m in images] == seen[1][-len(images) :]
    simulation.restore(foggy)
    assert simulation.world.weather.particles == Particles(fog_visibility_m=30.0)
    simulation.reset()
    assert simulation.world.weather.particles == CLEAR_AIR


def test_rain_is_the_same_in_runs_that_are_cut_otherwise(simulate, seeing_data):
    seeing_data["world"] = {"weather": {"rain_mm_h": 60.0, "snow_mm_h": 1.0}}
    digests = []
    for pieces, threads in ((1, 1), (7, 2)):
        simulation = simulate(seeing_data, threads=threads)
        simulation.diagnostics.enable_digest()
        for _ in range(pieces):
            simulation.run(0.35 / pieces)
        digests.append(simulation.diagnostics.digest())
    assert digests[0] == digests[1]


def test_the_rainy_forest_that_ships():
    scenario = load_scenario("forest_rain")
    assert scenario.world.weather.rain_mm_h > 0.0
    assert any(s.kind == "camera" for kind in scenario.types.values() for s in kind.sensors)
