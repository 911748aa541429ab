"""Admission of stations: checks a HELLO against the server's rules."""

from __future__ import annotations

from volery.comms.addresses import Identity
from volery.comms.control_payloads import Hello, Reason, Refusal
from volery.comms.server.settings import RouterSettings
from volery.core.errors import CommsError
from volery.core.network_access import shows_token
from volery.core.plurals import counted


def admit(hello: Hello, source: int, settings: RouterSettings) -> Refusal | None:
    """Returns None for a station that may join; else the refusal."""
    if not shows_token(hello.token, settings.token):
        return Refusal(Reason.TOKEN, 0, "the token is wrong, or there is none")
    planes = settings.group_size
    if hello.group_size != planes:
        text = f"here a batch has {counted(planes, 'plane')}, not {hello.group_size}"
        return Refusal(Reason.BATCH_SIZE, 0, text)
    try:
        address = Identity(hello.batch, hello.plane).address(planes)
    except CommsError as error:
        return Refusal(Reason.IDENTITY, 0, str(error))
    if address != source:
        text = f"batch {hello.batch}, plane {hello.plane} is station {address}, not {source}"
        return Refusal(Reason.IDENTITY, 0, text)
    return None
