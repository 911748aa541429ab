"""External subscribers of a simulation, as bridges have them: a session with queues."""

from volery.graph.typestore import typestore


class ExternalSubscriber:
    """Subscribes to topics as an external client; queues the messages."""

    def __init__(self, simulation, *topics, depth=10_000):
        self.session = simulation.gateway.open("watcher")
        self._depth = depth
        self._boxes = {}
        for topic in topics:
            self.subscribe(topic)

    def subscribe(self, topic):
        self._boxes[topic] = self.session.subscribe(topic, depth=self._depth, wake=lambda: None)

    def take(self, topic):
        """New messages of a topic; they must survive the wire."""
        return [
            typestore().deserialize_cdr(published.cdr, published.msgtype)
            for published in self._boxes[topic].take()
        ]

    def last(self, topic):
        """The newest of the new messages."""
        return self.take(topic)[-1]
