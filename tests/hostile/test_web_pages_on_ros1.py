"""A foreign web page posts XML-RPC to the port of our ROS 1 node."""

import http.client
import threading
from xmlrpc.client import ServerProxy, dumps

import pytest

from volery.bridges.ros1.environment import load_rospy, rospy_is_installed
from volery.bridges.ros1.port_guards import guard_ports, is_of_a_page


@pytest.mark.parametrize(
    ("headers", "expected"),
    [
        ({"Content-Type": "text/xml"}, False),
        ({"Content-Type": "text/xml; charset=utf-8"}, False),
        ({"Content-Type": "application/xml"}, False),
        ({"Content-Type": "text/plain"}, True),
        ({"Content-Type": "application/x-www-form-urlencoded"}, True),
        ({"Content-Type": "multipart/form-data; boundary=/xml"}, True),
        ({}, True),
        ({"Content-Type": "text/xml", "Origin": "null"}, True),
    ],
)
def test_what_only_programs_send(headers, expected):
    assert is_of_a_page(headers) == expected


@pytest.mark.skipif(not rospy_is_installed(), reason="rospy is not installed")
def test_programs_are_answered_and_pages_refused():
    load_rospy()
    guard_ports()
    guard_ports()  # a second time nothing happens
    import rosgraph.xmlrpc

    server = rosgraph.xmlrpc.ThreadingXMLRPCServer(("127.0.0.1", 0), 0)
    called = []
    server.register_function(lambda text: called.append(text) or text, "say")
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
    thread.start()
    host, port = server.server_address
    try:
        with ServerProxy(f"http://{host}:{port}") as program:
            assert program.say("from a program") == "from a program"
        for headers in ({"Content-Type": "text/plain"}, {"Origin": "https://stranger.example"}):
            page = http.client.HTTPConnection(host, port, timeout=60.0)
            page.request("POST", "/RPC2", dumps(("from a page",), "say"), headers)
            assert page.getresponse().status == 403
            page.close()
    finally:
        server.shutdown()
        thread.join()
        server.server_close()
    assert called == ["from a program"]
