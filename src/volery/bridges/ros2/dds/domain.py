"""DDS domains: their interfaces, and one configuration of each per process."""

from __future__ import annotations

import os
import socket
import threading
from collections.abc import Sequence
from xml.sax.saxutils import quoteattr

from cyclonedds.core import DDSException
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.qos import Policy, Qos

from volery.bridges.ros2.dds import library
from volery.bridges.ros2.dds.loopback_sockets import confine
from volery.core.errors import BridgeError

_ENCLAVE = b"enclave=/;"
"""Security enclave of the participant, in the form of rmw."""
_MAX_PARTICIPANTS = 32
"""Participants on one machine without multicast, for which rmw_cyclonedds probes with LOCALHOST
discovery."""
_RECEIVE_BUFFER = "4 MiB"
"""Receive buffer, if the system allows it: an image of 1 MB in pieces overruns the usual 208 KiB.
"""

_lock = threading.Lock()
_domains: dict[int, tuple[Domain, str, int]] = {}
"""Domains in use: their configuration and their number of participants here."""


def configuration(interfaces: Sequence[str] = (), lease_s: float = 10.0) -> str:
    """Returns a configuration of Cyclone DDS in XML.

    interfaces: names or addresses; without any, peers are discovered on this machine alone, through
    loopback without multicast, which many systems lack there. lease_s: time of silence after which
    others treat a participant as gone.
    """
    if interfaces:
        chosen = "".join(f"<NetworkInterface {_called(name)}/>" for name in interfaces)
        how, peers = "", ""
    else:
        chosen = '<NetworkInterface address="127.0.0.1"/>'
        # RTPS messages stay at Cyclone's 14,720 bytes: larger ones halve the time of 1 MB, but
        # overrun the usual receive buffers of 208 KiB, which Fast DDS does not change.
        how = "<AllowMulticast>false</AllowMulticast>"
        peers = (
            "<ParticipantIndex>auto</ParticipantIndex>"
            f"<MaxAutoParticipantIndex>{_MAX_PARTICIPANTS}</MaxAutoParticipantIndex>"
            '<Peers><Peer address="localhost"/></Peers>'
        )
    lease = f"<LeaseDuration>{lease_s:g} s</LeaseDuration>"
    return (
        '<CycloneDDS><Domain id="any">'
        f"<General><Interfaces>{chosen}</Interfaces>{how}</General>"
        f"<Discovery>{lease}{peers}</Discovery>"
        f'<Internal><SocketReceiveBufferSize max="{_RECEIVE_BUFFER}"/></Internal>'
        # Else each malformed packet would be printed on stderr, or, if only that is disabled, in a
        # file cyclonedds.log of the current folder.
        "<Tracing><Verbosity>severe</Verbosity>"
        f"<OutputFile>{os.devnull}</OutputFile></Tracing>"
        "</Domain></CycloneDDS>"
    )


def _is_address(interface: str) -> bool:
    return interface.replace(".", "").isdecimal() or ":" in interface


def _check_there(interfaces: Sequence[str]) -> None:
    there = [name for _number, name in socket.if_nameindex()]
    for name in interfaces:
        if not _is_address(name) and name not in there:
            raise BridgeError(f"unknown network interface '{name}'; known are {', '.join(there)}")


def _called(interface: str) -> str:
    key = "address" if _is_address(interface) else "name"
    return f"{key}={quoteattr(interface)}"


def join_domain(domain_id: int, interfaces: Sequence[str]) -> DomainParticipant:
    """Returns a new participant. Raises `BridgeError` if the domain cannot be joined like this."""
    _check_there(interfaces)
    config = configuration(interfaces)
    with _lock:
        known = _domains.get(domain_id)
        if known is not None and known[1] != config:
            raise BridgeError(
                f"DDS domain {domain_id} is in use in this process with other interfaces"
            )
        domain = None
        try:
            domain = known[0] if known else Domain(domain_id, config)
            participant = DomainParticipant(domain_id, qos=Qos(Policy.Userdata(data=_ENCLAVE)))
        except DDSException as error:
            if domain is not None and known is None:
                library.delete(domain)
            raise BridgeError(
                f"cannot join DDS domain {domain_id}: {error}. Do the interfaces exist, and do "
                f"fewer than {_MAX_PARTICIPANTS} other programs of this machine use it?"
            ) from None
        if not interfaces:
            confine(domain_id)
        _domains[domain_id] = (domain, config, 1 + (known[2] if known else 0))
        return participant


def leave_domain(domain_id: int, participant: DomainParticipant) -> None:
    """Deletes a participant, and with the last one the domain."""
    with _lock:
        library.delete(participant)
        domain, config, count = _domains.pop(domain_id)
        if count > 1:
            _domains[domain_id] = (domain, config, count - 1)
        else:
            library.delete(domain)
