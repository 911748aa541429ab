"""Reads the descriptions of endpoints, in any number of threads at once.

The package reads quality of service into variables that all threads share, and releases the lock in
between: two concurrent reads get parts of each other's data, or nothing. Its C functions therefore
receive functions of this module, which read into variables of their own.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from cyclonedds._clayer import (
    ddspy_get_matched_publication_data,
    ddspy_get_matched_subscription_data,
)
from cyclonedds.builtin import BuiltinDataReader, BuiltinTopic
from cyclonedds.domain import DomainParticipant

from volery.bridges.ros2.dds import library
from volery.bridges.ros2.middleware import Profile


class EndpointInfo(NamedTuple):
    """An endpoint."""

    key: bytes
    participant_key: bytes
    """Both GUIDs, 16 bytes."""
    dds_topic: str | None
    type_name: str | None
    terms: EndpointQos | None
    """None, like the names, in the sample of an endpoint that has left."""
    sample_info: Any
    """None if the endpoint was looked up."""


class EndpointQos(NamedTuple):
    """Quality of service of an endpoint, as far as needed."""

    profile: Profile
    """Offered or requested profile, without the depth."""
    user_data: bytes
    """User data of the endpoint: `typehash=...;`."""


def announcements(participant: DomainParticipant, topic: BuiltinTopic) -> BuiltinDataReader:
    """Returns a reader of appearing and leaving endpoints; its samples are `EndpointInfo`."""
    reader = BuiltinDataReader(participant, topic)
    reader._constructor, reader._cqos_conv = _announced, terms_at
    return reader


def matched_reader(writer: Any, handle: int) -> EndpointInfo | None:
    """Returns the reader of a writer with the instance handle; None if it has left."""
    found: EndpointInfo | None = ddspy_get_matched_subscription_data(
        writer._ref, handle, _announced, terms_at
    )
    return found


def matched_writer(reader: Any, handle: int) -> EndpointInfo | None:
    """Returns the writer of a reader with the instance handle; None if it has left."""
    found: EndpointInfo | None = ddspy_get_matched_publication_data(
        reader._ref, handle, _announced, terms_at
    )
    return found


def terms_at(qos: int) -> EndpointQos:
    """Returns the quality of service in a `dds_qos_t`, by its address."""
    profile = Profile(reliable=library.is_reliable(qos), latched=library.is_latched(qos))
    return EndpointQos(profile, library.user_data(qos))


def _announced(
    key: bytes,
    participant_key: bytes,
    _participant_handle: int,
    dds_topic: str | None,
    type_name: str | None,
    terms: EndpointQos | None,
    sample_info: Any,
    _type_id: bytes | None,
) -> EndpointInfo:
    return EndpointInfo(key, participant_key, dds_topic, type_name, terms, sample_info)
