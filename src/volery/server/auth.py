"""Who may do what: tokens, roles, sessions."""

from __future__ import annotations

import hashlib
import hmac
import secrets
from dataclasses import dataclass
from enum import StrEnum

from volery.core.errors import BridgeError
from volery.core.network_access import check_address, check_token, shows_token


class Role(StrEnum):
    """What somebody may do."""

    OPERATOR = "operator"
    """Everything."""
    VIEWER = "viewer"
    """Look on: subscribe, and call services that change nothing."""


@dataclass(frozen=True)
class Tokens:
    """What must be shown; without an operator's token everybody is an operator."""

    operator: str | None = None
    viewer: str | None = None

    @property
    def needed(self) -> bool:
        """Whether one must be shown at all."""
        return self.operator is not None

    def role_of(self, given: str | None) -> Role | None:
        """Role of who shows `given`; None: no token of ours."""
        if self.operator is None:
            return Role.OPERATOR
        # both are compared, so that the time tells nothing of which one is near
        operator = shows_token(given, self.operator)
        viewer = self.viewer is not None and shows_token(given, self.viewer)
        return Role.OPERATOR if operator else Role.VIEWER if viewer else None


def check_rights(host: str, tokens: Tokens, *, anywhere: bool) -> None:
    """`BridgeError` for an address beyond loopback without consent and token, or for half rights.

    anywhere: consent to listening beyond loopback.
    """
    check_address(host, anywhere=anywhere, flag="--allow-remote and --token")
    check_token(host, tokens.operator)
    if tokens.viewer is not None and (not tokens.needed or tokens.viewer == tokens.operator):
        raise BridgeError("--viewer-token needs a --token for operators, and another one")


class Sessions:
    """Tickets that browsers keep as a cookie, so that pictures and downloads need no token.

    A ticket is worth its role until this process ends; nothing is stored for it.
    """

    def __init__(self) -> None:
        self._secret = secrets.token_bytes(32)

    def ticket(self, role: Role) -> str:
        """A ticket for somebody who has shown the token of `role`."""
        return f"{role}-{hmac.new(self._secret, role.encode(), hashlib.sha256).hexdigest()}"

    def role_of(self, ticket: str | None) -> Role | None:
        """Role of a ticket; None where it is none of ours."""
        return next((role for role in Role if shows_token(ticket, self.ticket(role))), None)
