"""The sensor link over real sockets: several clients, slow ones, broken ones, and poses in."""

from __future__ import annotations

import socket

import numpy as np
import pytest
from ros_tcp_client import Loop, until

from volery.bridges.bridge_host import BridgeHost
from volery.bridges.sensor_link.client import SensorLinkClient
from volery.bridges.sensor_link.payloads import (
    decode_notice,
    decode_payload,
    encode_payload,
)
from volery.bridges.sensor_link.server import SensorLink
from volery.bridges.sensor_link.wire import SensorLinkKind, SensorLinkParser, encode_frame
from volery.core.errors import BridgeError
from volery.graph import messages as m
from volery.graph.codecs.cdr import encode_cdr
from volery.graph.messages import message_type
from volery.runtime import Simulation
from volery.scenario.load import load_scenario

Image = message_type("sensor_msgs/msg/Image")


@pytest.fixture
def loop():
    loop = Loop()
    yield loop
    loop.close()


@pytest.fixture
def bridges(loop):
    with BridgeHost(loop.gateway) as bridges:
        yield bridges


@pytest.fixture
def link(bridges):
    link = SensorLink(port=0, image_port=0)
    bridges.open(link)
    return link


class Plain:
    """A socket and a parser."""

    def __init__(self, port, receive_buffer=None):
        self.socket = socket.socket()
        if receive_buffer:
            self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, receive_buffer)
        self.socket.settimeout(60.0)
        self.socket.connect(("127.0.0.1", port))
        self.parser = SensorLinkParser()
        self.frames = []

    def next(self):
        while not self.frames:
            data = self.socket.recv(1 << 16)
            assert data, "the link was closed"
            self.frames += self.parser.feed(data)
        return self.frames.pop(0)

    def send(self, kind, uav, message, sequence=0):
        self.socket.sendall(encode_frame(kind, uav, sequence, 0, encode_payload(kind, message)))

    def close(self):
        self.socket.close()


@pytest.fixture
def connect():
    clients = []

    def connect(port, **options):
        clients.append(Plain(port, **options))
        return clients[-1]

    yield connect
    for client in clients:
        client.close()


def sonar(k=0):
    header = m.header(k * 1_000_000, "uav1/range")
    return m.Range(header, 0, 0.5, 0.125, 8.0, float(k), 0.0)


def scan(k=0):
    header = m.header(k * 1_000_000, "uav1/laser_horizontal")
    ranges = np.full(1081, k, np.float32)
    return m.LaserScan(header, -1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 30.0, ranges, ranges[:0])


def image(k=0, side=480):
    pixels = np.full(3 * side * side, k % 256, np.uint8)
    return Image(m.header(k * 1_000_000, "cam"), side, side, "rgb8", 0, 3 * side, pixels)


def pose(x=1.0, w=1.0, frame="map"):
    return m.PoseStamped(
        m.header(7, frame), m.Pose(m.Point(x, 2.0, 3.0), m.Quaternion(0.0, 0.0, 0.0, w))
    )


def wanted(loop, publisher):
    until(lambda: publisher.has_subscribers)


def collect(loop, topic, msgtype=m.PoseStamped):
    seen = []
    loop.do(lambda: loop.graph.subscribe(topic, seen.append, msgtype))
    return seen


def test_every_client_gets_what_the_sensors_measure(loop, link, connect):
    publisher = loop.graph.advertise("/uav12/range", m.Range)
    assert not publisher.has_subscribers  # without a client nothing is asked for
    clients = [connect(link.port) for _ in range(3)]
    wanted(loop, publisher)
    until(lambda: len(link.clients) == 3)
    for k in range(5):
        loop.publish(publisher, sonar(k))
    for client in clients:
        for k in range(5):
            frame = client.next()
            assert (frame.kind, frame.uav, frame.sequence) == (SensorLinkKind.SONAR, 12, k)
            name, message = decode_payload(frame.kind, frame.payload, frame.stamp_ns)
            assert name == "range"
            assert encode_cdr(message, "sensor_msgs/msg/Range") == encode_cdr(
                sonar(k), "sensor_msgs/msg/Range"
            )
    for client in clients:
        client.close()
    until(lambda: not publisher.has_subscribers)


def test_sensors_that_come_later_are_found(loop, link, connect):
    client = connect(link.port)
    until(lambda: link.clients)
    publisher = loop.graph.advertise("/uav3/laser/nodding/scan", m.LaserScan)
    wanted(loop, publisher)
    loop.publish(publisher, scan(1))
    assert client.next().uav == 3


def test_poses_go_in(loop, link, connect):
    loop.graph.advertise("/uav2/odom", m.Odometry)
    commands, goals = collect(loop, "/uav2/pose_command"), collect(loop, "/uav2/goal_pose")
    client = connect(link.port)
    client.send(SensorLinkKind.POSE_COMMAND, 2, pose(4.0))
    client.send(SensorLinkKind.GOAL_POSE, 2, pose(5.0, w=0.0))
    until(lambda: commands and goals)
    assert commands[0].message.pose.position.x == 4.0
    assert goals[0].message.pose.position.x == 5.0
    assert goals[0].message.header.frame_id == "map"


@pytest.mark.parametrize(
    ("kind", "uav", "message", "words"),
    [
        (SensorLinkKind.POSE_COMMAND, 9, pose(), "no UAV 9"),
        (SensorLinkKind.POSE_COMMAND, 2, pose(w=0.5), "length 1"),
        (SensorLinkKind.POSE_COMMAND, 2, pose(w=0.0), "length 1"),
        (SensorLinkKind.POSE_COMMAND, 2, pose(float("nan")), "finite"),
        (SensorLinkKind.POSE_COMMAND, 2, pose(frame="odom"), "'map'"),
        (SensorLinkKind.SONAR, 2, sonar(), "not accepted here"),
    ],
)
def test_what_cannot_be_done_is_reported(loop, link, connect, kind, uav, message, words):
    loop.graph.advertise("/uav2/odom", m.Odometry)
    client = connect(link.port)
    client.send(kind, uav, message, sequence=77)
    frame = client.next()
    assert frame.kind == SensorLinkKind.NOTICE
    assert words in decode_notice(frame.payload)
    assert "77" in decode_notice(frame.payload)


def test_damage_is_counted_and_what_follows_is_taken(loop, link, connect):
    loop.graph.advertise("/uav2/odom", m.Odometry)
    seen = collect(loop, "/uav2/pose_command")
    client = connect(link.port)
    whole = encode_frame(
        SensorLinkKind.POSE_COMMAND, 2, 0, 0, encode_payload(SensorLinkKind.POSE_COMMAND, pose())
    )
    broken = bytearray(whole)
    broken[40] ^= 4
    client.socket.sendall(b"\x00\xaaV" + bytes(broken) + whole)
    until(lambda: seen)
    (info,) = link.clients
    assert (info.received, info.corrupt) == (1, 1)


def test_a_client_of_another_version_is_notified_once(link, connect):
    client = connect(link.port)
    frame = bytearray(encode_frame(SensorLinkKind.POSE_COMMAND, 2, 0, 0, b""))
    frame[4] = 2
    from test_sensor_link import slow_crc

    frame[24:26] = slow_crc(bytes(frame[4:24])).to_bytes(2, "little")
    client.socket.sendall(bytes(frame) * 3)
    assert "version 1" in decode_notice(client.next().payload)
    until(lambda: link.clients[0].corrupt == 3)
    assert link.clients[0].waiting == 0


def test_a_client_that_sends_too_much_is_notified_once_and_may_go_on(loop, link, connect):
    loop.graph.advertise("/uav2/odom", m.Odometry)
    commands = collect(loop, "/uav2/pose_command")
    client = connect(link.port)
    client.socket.sendall(encode_frame(SensorLinkKind.POSE_COMMAND, 2, 0, 0, bytes(5000)) * 3)
    notice = decode_notice(client.next().payload)
    assert notice == "a payload of type 128 with 5000 bytes is over 4096 bytes"
    client.send(SensorLinkKind.POSE_COMMAND, 2, pose(4.0))
    until(lambda: commands)
    assert link.clients[0].waiting == 0


def test_a_client_that_does_not_read_loses_its_own_oldest_only(loop, link, connect):
    publisher = loop.graph.advertise("/uav1/laser/horizontal/scan", m.LaserScan)
    slow, quick = connect(link.port, receive_buffer=4096), connect(link.port)
    wanted(loop, publisher)
    until(lambda: len(link.clients) == 2)
    for k in range(3000):
        loop.publish(publisher, scan(k))
        assert quick.next().sequence == k
    info = next(info for info in link.clients if info.dropped)
    assert info.dropped > 1000
    assert info.waiting <= 20
    numbers = [slow.next().sequence]
    while numbers[-1] < 2999:
        numbers.append(slow.next().sequence)
    assert numbers == sorted(set(numbers))
    assert numbers[-20:] == list(range(2980, 3000))


def test_images_have_a_port_of_their_own(loop, link, connect):
    camera = loop.graph.advertise("/uav1/camera/image_raw", Image)
    laser = loop.graph.advertise("/uav1/laser/horizontal/scan", m.LaserScan)
    sensors, images = connect(link.port), connect(link.image_port)
    wanted(loop, camera)
    wanted(loop, laser)
    loop.publish(camera, image(3))
    loop.publish(laser, scan(4))
    assert sensors.next().kind == SensorLinkKind.LASER_SCAN
    frame = images.next()
    name, found = decode_payload(frame.kind, frame.payload, frame.stamp_ns)
    assert name == "camera/image_raw"
    assert encode_cdr(found, "sensor_msgs/msg/Image") == encode_cdr(
        image(3), "sensor_msgs/msg/Image"
    )


def test_unread_images_delay_no_scan(loop, link, connect):
    camera = loop.graph.advertise("/uav1/camera/image_raw", Image)
    laser = loop.graph.advertise("/uav1/laser/horizontal/scan", m.LaserScan)
    sensors, images = connect(link.port), connect(link.image_port, receive_buffer=1 << 16)
    wanted(loop, camera)
    wanted(loop, laser)
    for k in range(60):
        loop.post(lambda k=k: camera.publish(image(k, 640)))
        loop.publish(laser, scan(k))
        assert sensors.next().sequence == k  # behind images that are not read it would never come
    info = next(info for info in link.clients if "images" in info.name)
    assert info.waiting <= 1
    frames = [images.next()]
    while frames[-1].stamp_ns < 59_000_000:  # the newest comes whatever was left out before it
        frames.append(images.next())
    numbers = [frame.sequence for frame in frames]
    assert numbers == sorted(set(numbers))
    assert len(numbers) < 60


def test_images_at_a_rate_of_their_own(loop, bridges, connect):
    link = SensorLink(port=0, image_port=0, image_rate_hz=10.0)
    bridges.open(link)
    clock = [0]
    loop.graph._now_ns = lambda: clock[0]
    camera = loop.graph.advertise("/uav1/camera/image_raw", Image)
    images = connect(link.image_port)
    wanted(loop, camera)
    first_of_each_tenth, stamps = (0, 3, 7, 10, 13, 16, 19), []  # 99 ms are a tenth, rounded
    for k in range(20):
        clock[0] = k * 33_000_000
        loop.publish(camera, image(k, 8))
        if k in first_of_each_tenth:  # a client that lags has only the newest
            stamps.append(images.next().stamp_ns)
    clock[0] = 1_000_000  # the simulation went back
    loop.publish(camera, image(99, 8))
    stamps.append(images.next().stamp_ns)
    assert stamps == [k * 1_000_000 for k in (*first_of_each_tenth, 99)]


def test_a_port_in_use(link, bridges):
    with pytest.raises(BridgeError, match=r"in use.*choose another"):
        bridges.open(SensorLink(port=link.port, image_port=0))
    with pytest.raises(BridgeError, match="in use"):
        bridges.open(SensorLink(port=0, image_port=link.image_port))


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"host": "0.0.0.0"}, "anywhere"),
        ({"image_rate_hz": 0.0}, "rate"),
    ],
)
def test_what_cannot_be_opened(options, words):
    with pytest.raises(BridgeError, match=words):
        SensorLink(**options)


def test_closing_lets_all_go(loop, link, bridges, connect):
    clients = [connect(link.port), connect(link.image_port)]
    until(lambda: len(link.clients) == 2)
    bridges.close()
    for client in clients:
        with pytest.raises((AssertionError, ConnectionError)):
            client.next()
    assert loop.gateway.sessions() == []


# ------------------------------------------------------------------------------ the ROS side


@pytest.fixture
def ros():
    loop = Loop()
    yield loop
    loop.close()


def joined(ros, link):
    bridges = BridgeHost(ros.gateway)
    client = SensorLinkClient(port=link.port, image_port=link.image_port)
    bridges.open(client)
    return bridges, client


def subscribed(gateway):
    return {box.topic for session in gateway.sessions() for box in session.queues}


def test_two_graphs_joined(loop, link, ros):
    loop.graph.advertise("/uav1/odom", m.Odometry)
    laser = loop.graph.advertise("/uav1/laser/horizontal/scan", m.LaserScan)
    camera = loop.graph.advertise("/uav1/camera/image_raw", Image)
    scans = collect(ros, "/uav1/laser/horizontal/scan", m.LaserScan)
    images = collect(ros, "/uav1/camera/image_raw", Image)
    goals = collect(loop, "/uav1/goal_pose")
    bridges, client = joined(ros, link)
    with bridges:
        wanted(loop, laser)
        wanted(loop, camera)
        for k in range(10):
            loop.publish(laser, scan(k))
        loop.publish(camera, image(5))
        until(lambda: len(scans) == 10 and images)
        for k, published in enumerate(scans):
            assert published.cdr == encode_cdr(scan(k), "sensor_msgs/msg/LaserScan")
        until(lambda: ros.graph.topic_type("/uav1/goal_pose"))
        commander = ros.graph.advertise("/uav1/goal_pose", m.PoseStamped)
        ros.publish(commander, pose(8.0))
        until(lambda: goals)
        assert goals[0].cdr == encode_cdr(pose(8.0), "geometry_msgs/msg/PoseStamped")
        ros.publish(commander, pose(9.0, w=0.5))
        until(lambda: client.notices)
        assert "length 1" in client.notices[0]
        assert (client.lost, client.refused) == (0, 0)


def test_a_flight_seen_from_the_ros_side(ros):
    """What comes over the link is what the simulation publishes, byte for byte."""
    sent, received = {}, []
    scenario = load_scenario("hover")
    with Simulation(scenario, threads=1) as simulation, BridgeHost(simulation.gateway) as bridges:
        link = SensorLink(port=0, image_port=0)
        bridges.open(link)
        ros.do(lambda: ros.graph.subscribe_all(received.append))
        ros_bridges, client = joined(ros, link)
        simulation.graph.subscribe_all(lambda p: sent.setdefault((p.topic, p.cdr)))
        with ros_bridges:
            until(lambda: "/uav1/imu" in subscribed(simulation.gateway))

            def has_come():  # a slow reader receives the newest alone
                simulation.run(0.1)
                return {p.topic for p in received} >= {"/uav1/imu", "/uav1/odom"} and (
                    len(received) > 20
                )

            until(has_come)
        assert client.refused == client.corrupt == 0
    assert all((published.topic, published.cdr) in sent for published in received)


def test_the_ros_side_joins_again(loop, bridges, ros, hold_port):
    port, image_port = hold_port(), hold_port()
    link = SensorLink(port=port, image_port=image_port)
    bridges.open(link)
    publisher = loop.graph.advertise("/uav1/range", m.Range)
    seen = collect(ros, "/uav1/range", m.Range)
    ros_bridges, _ = joined(ros, link)
    with ros_bridges:
        wanted(loop, publisher)
        bridges.call(link.stop())
        until(lambda: not publisher.has_subscribers)
        again = SensorLink(port=port, image_port=image_port)
        bridges.open(again)
        wanted(loop, publisher)
        loop.publish(publisher, sonar(1))
        until(lambda: seen)


def test_no_server_listens(ros):
    with BridgeHost(ros.gateway) as bridges, pytest.raises(BridgeError, match="no server on"):
        bridges.open(SensorLinkClient(port=1))
