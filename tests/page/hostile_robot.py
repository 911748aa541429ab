"""A rosbridge whose every name and text is hostile: what a page must show and never run."""

import json
import threading
import time
from contextlib import contextmanager

from websockets.exceptions import ConnectionClosed
from websockets.sync.server import serve

RUN = "window.injected=(window.injected||0)+1"
TEXTS = (
    f"<img src=x onerror={RUN}>",
    f'"><script>{RUN}</script>',
    f"javascript:{RUN}",
    f"';{RUN};//",
    f"<a href='javascript:{RUN}'>press</a>",
    f"<svg/onload={RUN}>",
    "{{constructor.constructor('window.injected=1')()}}",
    "__proto__",
    "constructor",
    "\u202etxt.exe\u202c",
    "\x1b]0;title\x07\x00",
)
LONG = "x" * 10_000
SENT_S = 0.2


def topics():
    """Topics by name, with their types: hostile names of every type that the page shows."""
    names = {f"/{text}/{i}": "std_msgs/msg/String" for i, text in enumerate((*TEXTS, LONG))}
    shown = TEXTS[0]
    return names | {
        f"/{shown}/image": "sensor_msgs/msg/Image",
        f"/{shown}/points": "sensor_msgs/msg/PointCloud2",
        f"/{shown}/markers": "visualization_msgs/msg/MarkerArray",
        f"/{shown}/type": f"{shown}/msg/{shown}",
        "/events": "std_msgs/msg/String",
        "/volery/log": "volery_interfaces/msg/CommandRecord",
        "/volery/vehicles": "volery_interfaces/msg/VehicleStates",
        "/tf": "tf2_msgs/msg/TFMessage",
    }


def message(topic, kind):
    """A message with hostile texts."""
    texts = [*TEXTS, LONG]
    stamp = {"sec": 1, "nanosec": 0}
    header = {"stamp": stamp, "frame_id": TEXTS[0]}
    zero = {"x": 0.0, "y": 0.0, "z": 2.0}
    turn = {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}
    match kind.rpartition("/")[2]:
        case "String" if topic == "/events":
            event = {"time_ns": 1, "uav": TEXTS[0], "kind": "battery", "position_map": [0, 0, 0]}
            return {"data": json.dumps(event | {"speed_m_s": 1, "partner": "", "detail": texts[1]})}
        case "String":
            return {"data": "\n".join(texts)}
        case "CommandRecord":
            fields = {"client": TEXTS[0], "kind": "refused", "name": TEXTS[1], "content": LONG}
            return {"stamp": stamp} | fields
        case "VehicleStates":
            return {"vehicles": [vehicle(text, zero) for text in texts]}
        case "TFMessage":
            moved = {"translation": zero, "rotation": turn}
            return {
                "transforms": [
                    {
                        "header": {"stamp": stamp, "frame_id": "map"},
                        "child_frame_id": f"{text}/base_link",
                        "transform": moved,
                    }
                    for text in texts
                ]
            }
        case "MarkerArray":
            look = {"r": 1.0, "g": 1.0, "b": 1.0, "a": 1.0}
            pose = {"position": zero, "orientation": turn}
            size = {"x": 1.0, "y": 1.0, "z": 1.0}
            common = {"type": 9, "action": 0, "pose": pose, "scale": size, "color": look}
            at = {"header": header | {"frame_id": "map"}, "points": [], "colors": []}
            return {
                "markers": [
                    {"ns": text, "id": i, "text": text} | common | at
                    for i, text in enumerate(texts)
                ]
            }
        case _:
            return {"header": header, "encoding": TEXTS[0], "data": TEXTS[0]}


def vehicle(name, position):
    """State of a UAV of this name."""
    texts = {"name": name, "airframe": name, "type": name, "mode": name, "operator": name}
    figures = {"battery": 0.5, "voltage": 11.1, "rotor_speed": 1.0, "command_age": -1.0}
    flags = {"airborne": True, "crashed": False}
    return texts | figures | flags | {"position": position, "velocity": position}


@contextmanager
def hostile_robot():
    """URL of the robot's rosbridge, while it runs."""
    with serve(_talk, "127.0.0.1", 0) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        try:
            yield f"ws://127.0.0.1:{server.socket.getsockname()[1]}"
        finally:
            server.shutdown()
            thread.join()


def _talk(socket):
    wanted, ends = {}, threading.Event()
    publisher = threading.Thread(target=_publish, args=(socket, wanted, ends))
    publisher.start()
    try:
        for text in socket:
            operation = json.loads(text)
            if operation["op"] == "subscribe":
                wanted[operation["topic"]] = operation.get("type") or "std_msgs/msg/String"
            elif operation["op"] == "unsubscribe":
                wanted.pop(operation["topic"], None)
            elif operation["op"] == "call_service":
                socket.send(json.dumps(_respond(operation)))
    finally:
        ends.set()
        publisher.join()


def _publish(socket, wanted, ends):
    known, sent_once = topics(), set()
    while not ends.wait(SENT_S):
        for topic in [name for name in list(wanted) if name in known and name not in sent_once]:
            if topic == "/events":  # a notification of each
                sent_once.add(topic)
            operation = {"op": "publish", "topic": topic, "msg": message(topic, known[topic])}
            try:
                socket.send(json.dumps(operation))
            except ConnectionClosed:
                return


def _respond(operation):
    response = {
        "op": "service_response",
        "service": operation["service"],
        "id": operation.get("id"),
    }
    match operation["service"]:
        case "/rosapi/topics":
            known = topics()
            return response | {
                "result": True,
                "values": {"topics": list(known), "types": list(known.values())},
            }
        case "/rosapi/services":
            services = [f"/{text}/service" for text in (*TEXTS, LONG)]
            return response | {"result": True, "values": {"services": services}}
        case "/rosapi/service_type":
            return response | {"result": True, "values": {"type": f"{TEXTS[0]}/srv/{TEXTS[1]}"}}
        case "/rosapi/get_time":
            now = time.time()
            stamp = {"sec": int(now), "nanosec": 0}
            return response | {"result": True, "values": {"time": stamp}}
        case _:
            return response | {"result": False, "values": f"{TEXTS[0]} {TEXTS[1]} {LONG}"}
