"""Calls of a simulation's services, as bridges make them, with plain data for requests."""

from volery.graph.codecs.zero import zero_message
from volery.graph.messages import message_type
from volery.graph.service_reply import ServiceReply
from volery.graph.typestore import typestore

STANDARD = "simulation_interfaces"


def fill(message, data):
    """Set fields of a message from nested dicts and lists."""
    fields = dict(typestore().fielddefs[message.__msgtype__][1])
    for key, value in data.items():
        if isinstance(value, dict):
            fill(getattr(message, key), value)
        elif isinstance(value, list) and value and isinstance(value[0], dict):
            (_kind, ((_inner, inner_type), _size)) = fields[key]
            setattr(message, key, [fill(zero_message(inner_type), one) for one in value])
        else:
            setattr(message, key, value)
    return message


def request_of(graph, service, **fields):
    return fill(zero_message(f"{graph.services()[service]}_Request"), fields)


def call_service(simulation, service, **fields):
    """The response of a service that responds at once; it must survive the wire."""
    response = simulation.graph.call(service, request_of(simulation.graph, service, **fields))
    name = f"{simulation.graph.services()[service]}_Response"
    assert response.__msgtype__ == name
    data = typestore().serialize_cdr(response, name)
    return typestore().deserialize_cdr(data, name)


def start_call(simulation, service, **fields):
    """A list that will hold the response."""
    responses = []
    reply = ServiceReply(responses.append, responses.append)
    request = request_of(simulation.graph, service, **fields)
    simulation.graph.call_async(service, request, reply)
    return responses


def code_of(response):
    return response.result.result


def constant(name, which):
    return getattr(message_type(f"{STANDARD}/msg/{name}"), which)
