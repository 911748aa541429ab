"""Registers a node's topics and services with the ROS 1 master, also after a restart of the master.

rospy's own registrar retries without end while no master answers, holding locks that publishing and
closing need, and never checks whether a restarted master still has the node.
"""

from __future__ import annotations

import threading
from typing import Any

from volery.bridges.ros1.master import Ros1Master
from volery.core.errors import BridgeError

_METHODS = {"pub": "Publisher", "sub": "Subscriber", "srv": "Service"}


class Ros1Registrar:
    """Replaces rospy's registrar after that has registered the node itself."""

    def __init__(self, rospy: Any, master: Ros1Master, node_name: str) -> None:
        self._registration = rospy.impl.registration
        self._master = master
        # rospy registers this service when the node starts, and nothing does so later: a master
        # that has it has everything, while new topics may be registered with a new master at any
        # time.
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
        """Registers everything that the master lacks; returns whether it lacked anything.

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
        """Registers a topic of a type, or a service at an address."""
        try:
            answer = self._master.ask(f"register{_METHODS[kind]}", name, what, self._uri)
        except (OSError, BridgeError):
            self._missed.set()
            return
        if kind == "sub":
            self._connector.publisher_update(name, answer)

    def removed(self, name: str, what: str, kind: str) -> None:
        """Removes a registration; a restarted master has none."""
        try:
            self._master.ask(
                f"unregister{_METHODS[kind]}", name, what if kind == "srv" else self._uri
            )
        except (OSError, BridgeError):
            return

    def _listener(self) -> Any:
        registrar = self

        class Listener(self._registration.RegistrationListener):  # type: ignore[misc,name-defined]
            """Forwards to the registrar."""

            def reg_added(self, name: str, what: str, kind: str) -> None:
                registrar.added(name, what, kind)

            def reg_removed(self, name: str, what: str, kind: str) -> None:
                registrar.removed(name, what, kind)

        return Listener()
