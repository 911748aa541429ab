"""Selects the topics of a log by patterns; without patterns all, each image once."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from volery.bridges.topic_patterns import topic_filter
from volery.graph.graph import Graph

EVERYTHING = ("/**",)
_SECOND_FORMS = (
    ("/image_raw", "{base}/image_raw/compressed"),
    ("/depth/compressedDepth", "{base}/depth"),
    ("/points", "{base}/depth"),
)
"""Topics of a camera that are skipped if another topic has the same image.

Colour images stay compressed, depth images lossless; points are skipped for the depth image.
"""


def recorded_topics(
    graph: Graph, topics: Iterable[str] = (), exclude: Iterable[str] = ()
) -> Callable[[str], bool]:
    """Returns a function that tests by its name whether a topic is recorded.

    Parameters
    ----------
    graph
        Graph of the topics: a raw image is skipped only if a compressed one is published.
    topics
        Patterns of `topic_patterns`. Without any: all topics, each image in one form.
    exclude
        Patterns of topics that are never recorded.

    Raises
    ------
    GraphError
        A pattern is invalid.

    """
    chosen = tuple(topics)
    matches = topic_filter(chosen or EVERYTHING, exclude)
    if chosen:
        return matches
    answers: dict[str, bool] = {}

    def is_recorded(topic: str) -> bool:
        answer = answers.get(topic)
        if answer is None:
            answer = matches(topic) and not _has_another_form(graph, topic)
            answers[topic] = answer
        return answer

    return is_recorded


def _has_another_form(graph: Graph, topic: str) -> bool:
    for end, other in _SECOND_FORMS:
        if topic.endswith(end):
            base = topic.removesuffix(end)
            return (
                graph.publishers(f"{base}/camera_info") > 0
                and graph.publishers(other.format(base=base)) > 0
            )
    return False
