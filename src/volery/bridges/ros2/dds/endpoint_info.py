"""What endpoints tell of themselves, for any number of threads that read it at once.

The package reads quality of service into variables that all threads share, and gives other threads
their turn in between: two that read at once get parts of each other's, or nothing. Its C functions
are therefore given functions of ours, which read what is needed here into variables of their own.
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
    """None, like the names, in the sample that tells that it has left."""
    sample_info: Any
    """None where it was looked up."""


class EndpointQos(NamedTuple):
    """Its policies, as far as they matter here."""

    profile: Profile
    """What it offers or asks for; the depth is not looked at."""
    user_data: bytes
    """Words that came with it: `typehash=...;`."""


def announcements(participant: DomainParticipant, topic: BuiltinTopic) -> BuiltinDataReader:
    """Reader of endpoints as they come and go; its samples are `EndpointInfo`."""
    reader = BuiltinDataReader(participant, topic)
    reader._constructor, reader._cqos_conv = _announced, terms_at
    return reader


def matched_reader(writer: Any, handle: int) -> EndpointInfo | None:
    """The reader of a writer that has the instance handle; None if it has left."""
    found: EndpointInfo | None = ddspy_get_matched_subscription_data(
        writer._ref, handle, _announced, terms_at
    )
    return found


def matched_writer(reader: Any, handle: int) -> EndpointInfo | None:
    """The writer of a reader that has the instance handle; None if it has left."""
    found: EndpointInfo | None = ddspy_get_matched_publication_data(
        reader._ref, handle, _announced, terms_at
    )
    return found


def terms_at(qos: int) -> EndpointQos:
    """Terms in a `dds_qos_t`, by its address."""
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
