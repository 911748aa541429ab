"""Registers what a node has with the ROS 1 master, also with one that went away and came back.

rospy's own registrar tries without end while no master answers, holding locks that publishing and
leaving need, and never looks whether a master that began anew still knows the node.
"""

from __future__ import annotations

import threading
from typing import Any

from volery.bridges.ros1.master import Ros1Master
from volery.core.errors import BridgeError

_METHODS = {"pub": "Publisher", "sub": "Subscriber", "srv": "Service"}


class Ros1Registrar:
    """Takes the place of rospy's registrar once that has registered the node itself."""

    def __init__(self, rospy: Any, master: Ros1Master, node_name: str) -> None:
        self._registration = rospy.impl.registration
        self._master = master
        # rospy registers this service when the node begins, and nothing does so later: a master
        # that knows it knows all, while new topics may come to a new master at any time.
        self._sign = f"{node_name}/get_loggers"
        self._uri = rospy.get_node_uri()
        self._missed = threading.Event()
        listeners = self._registration.get_registration_listeners()
        (self._connector,) = [
            found
            for found in listeners.listeners
            if isinstance(found, self._registration.RegManager)
        ]
        listeners.listeners[:] = [self._listener()]

    def register_again(self) -> bool:
        """Register everything if the master has forgotten or missed it; whether it had.

        Raises
        ------
        OSError
            The master does not answer.

        """
        if not self._missed.is_set() and self._master.knows_service(self._sign):
            return False
        self._missed.clear()
        topics = self._registration.get_topic_manager()
        services = self._registration.get_service_manager()
        for kind, names in (
            ("pub", topics.get_publications()),
            ("sub", topics.get_subscriptions()),
            ("srv", services.get_services()),
        ):
            for name, what in names:
                self.added(name, what, kind)
        return True

    def added(self, name: str, what: str, kind: str) -> None:
        """Register a topic of a type, or a service at an address."""
        try:
            answer = self._master.ask(f"register{_METHODS[kind]}", name, what, self._uri)
        except (OSError, BridgeError):
            self._missed.set()
            return
        if kind == "sub":
            self._connector.publisher_update(name, answer)

    def removed(self, name: str, what: str, kind: str) -> None:
        """Take a registration back; a master that is away forgets by itself."""
        try:
            self._master.ask(
                f"unregister{_METHODS[kind]}", name, what if kind == "srv" else self._uri
            )
        except (OSError, BridgeError):
            return

    def _listener(self) -> Any:
        registrar = self

        class Listener(self._registration.RegistrationListener):  # type: ignore[misc,name-defined]
            """Passes on."""

            def reg_added(self, name: str, what: str, kind: str) -> None:
                registrar.added(name, what, kind)

            def reg_removed(self, name: str, what: str, kind: str) -> None:
                registrar.removed(name, what, kind)

        return Listener()
