"""Tokens, sessions, and addresses beyond this machine."""

import pytest

from volery.core.errors import BridgeError
from volery.server.auth import Role, Sessions, Tokens, check_rights


@pytest.mark.parametrize(
    ("tokens", "given", "role"),
    [
        (Tokens(), None, Role.OPERATOR),
        (Tokens(), "anything", Role.OPERATOR),
        (Tokens("a"), None, None),
        (Tokens("a"), "", None),
        (Tokens("a"), "b", None),
        (Tokens("a"), "a", Role.OPERATOR),
        (Tokens("a", "b"), "b", Role.VIEWER),
        (Tokens("ä"), "ä", Role.OPERATOR),
        (Tokens("a"), "\udcff", None),
    ],
)
def test_what_a_token_is_worth(tokens, given, role):
    assert tokens.role_of(given) is role


def test_a_ticket_is_worth_its_role_here_and_nowhere_else():
    sessions, others = Sessions(), Sessions()
    for role in Role:
        ticket = sessions.ticket(role)
        assert sessions.role_of(ticket) is role
        assert others.role_of(ticket) is None
        forged = ticket.replace(role, Role.OPERATOR if role is Role.VIEWER else Role.VIEWER)
        assert sessions.role_of(forged) is None
    assert sessions.role_of(None) is None
    assert sessions.role_of("") is None


@pytest.mark.parametrize(
    ("host", "tokens", "anywhere", "why"),
    [
        ("0.0.0.0", Tokens("a"), False, "--allow-remote"),
        ("0.0.0.0", Tokens(), True, "set a --token"),
        ("127.0.0.1", Tokens(None, "b"), False, "needs a --token"),
        ("127.0.0.1", Tokens("a", "a"), False, "different from it"),
    ],
)
def test_half_rights_are_refused(host, tokens, anywhere, why):
    with pytest.raises(BridgeError, match=why):
        check_rights(host, tokens, anywhere=anywhere)


@pytest.mark.parametrize(
    ("host", "tokens", "anywhere"),
    [("127.0.0.1", Tokens(), False), ("0.0.0.0", Tokens("a", "b"), True)],
)
def test_whole_rights_pass(host, tokens, anywhere):
    try:
        check_rights(host, tokens, anywhere=anywhere)
    except BridgeError as error:
        pytest.fail(str(error))
