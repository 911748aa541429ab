"""Patterns of clients: no pattern takes longer than its length times that of what it is held to."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from whole_world import Client

from volery.bridges.topic_patterns import topic_filter
from volery.core.errors import GraphError
from volery.graph.codecs.zero import zero_message
from volery.runtime.services.filters import name_filter
from volery.runtime.services.results import RefusedError

LONG = "a" * 20_000
CATASTROPHIC = [
    "(|||||||||){14}x",
    "(a+)+$",
    "(a*)*$",
    "([a-zA-Z]+)*$",
    "(a|aa)+$",
    "(a|a?)+$",
    "(.*a){20}",
    "(.*)*x",
    "((a*)*)*$",
    "(a{0,30}){0,30}x",
    "(x+x+)+y",
    "a?" * 60 + "a" * 60,
    "(((((a{1,9}){1,9}){1,9}){1,9}){1,9}){1,9}",
    "a{1000}{1000}",
    "(" * 150 + ")" * 150 + "*",
    "[[:alpha:]]*[[:alpha:]]*[[:alpha:]]*[[:alpha:]]*!",
    "|" * 200,
]


@pytest.mark.timeout(600, func_only=True)
@pytest.mark.parametrize("pattern", CATASTROPHIC)
def test_catastrophic_filters_are_answered_or_refused_at_once(pattern):
    try:
        passes = name_filter(pattern)
    except RefusedError:
        return
    assert {passes(LONG), passes(LONG + "!")} <= {True, False}


@pytest.mark.timeout(600, func_only=True)
def test_a_viewers_filter_does_not_freeze_the_simulation(simulate, flat_data):
    client = Client(simulate(flat_data))
    request = zero_message("simulation_interfaces/srv/GetEntities_Request")
    request.filters.filter = "(|||||||||){14}x"
    response = client.call("/get_entities", request)
    assert response.result.result in (1, 4)
    client.simulation.step(1)


@pytest.mark.parametrize(
    ("pattern", "names"),
    [
        ("", ["uav1", "uav12", "walker", "a_b"]),
        ("^uav[[:digit:]]$", ["uav1"]),
        ("[[:digit:]]+", ["uav1", "uav12"]),
        ("^[[:alpha:]]+$", ["walker"]),
        ("(1|2)$", ["uav1", "uav12"]),
        ("v.{2}", ["uav12"]),
        ("uav1?2", ["uav12"]),
        ("[^[:alnum:]]", ["a_b"]),
        ("[[:punct:]]", ["a_b"]),
        ("WALKER", []),
        ("k|_", ["walker", "a_b"]),
    ],
)
def test_filters_are_posix_extended(pattern, names):
    passes = name_filter(pattern)
    assert [name for name in ("uav1", "uav12", "walker", "a_b") if passes(name)] == names


@pytest.mark.parametrize("pattern", ["(", "[", "a{2,1}", "*", "[[:x:]]", "a" * 201, "\ud800"])
def test_what_is_no_expression_is_refused(pattern):
    with pytest.raises(RefusedError):
        name_filter(pattern)


@pytest.mark.parametrize("pattern", [r"(?=a)b", r"(a)\1", r"(?<!a)b"])
def test_what_needs_backtracking_is_refused(pattern):
    with pytest.raises(RefusedError):
        name_filter(pattern)


@given(st.text(alphabet="a(|)*+?{1,9}[]^$.\\:-bd\0é", max_size=200), st.text(max_size=50))
def test_any_text_is_a_filter_or_is_refused(pattern, name):
    try:
        passes = name_filter(pattern)
    except RefusedError:
        return
    assert passes(name) in (True, False)


@pytest.mark.timeout(600, func_only=True)
@pytest.mark.parametrize("pattern", ["/" + "*?" * 99, "/" + "**" * 99, "/*" * 99, "/" + "a*" * 99])
def test_patterns_of_topics_take_no_longer(pattern):
    try:
        passes = topic_filter([pattern])
    except GraphError:
        return
    assert {passes("/" + "a" * 5_000), passes("/a" * 2_000)} <= {True, False}
