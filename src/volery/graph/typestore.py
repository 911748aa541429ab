"""Provides the store of all message types, of `rosbags` and of the files in `definitions/`."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

from rosbags.typesys import Stores, get_typestore

from volery.graph.codecs.definition_store import DefinitionStore
from volery.graph.message_defaults import make_arguments_optional
from volery.graph.message_methods import add_methods

_DEFINITIONS = Path(__file__).parent / "definitions"
_MODULE = "volery.graph.messages"
"""Module from which pickled messages import the classes of definition files."""
_BASE_DEFAULTS = {("geometry_msgs/msg/Quaternion", "w"): 1.0}
"""Defaults in the definition files of ROS 2, which the types of `rosbags` lack."""


@cache
def typestore() -> DefinitionStore:
    """Returns the ROS 2 types (Jazzy) and those of the definition files in `definitions/`.

    Each file is read at the first request for one of its types.
    """
    store = DefinitionStore(get_typestore(Stores.ROS2_JAZZY), _MODULE)
    store.index_folder(_DEFINITIONS)
    return store


def _base_default(msgtype: str, field: str) -> Any:
    return _BASE_DEFAULTS.get((msgtype, field))


def _complete_base_types() -> None:
    base = get_typestore(Stores.ROS2_JAZZY)
    for name, cls in base.types.items():
        make_arguments_optional(name, cls, base.types, base.fielddefs, _base_default)
        add_methods(name, cls, base.fielddefs)


_complete_base_types()
