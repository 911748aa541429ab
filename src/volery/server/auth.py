"""Authorization: tokens, roles, sessions."""

from __future__ import annotations

import hashlib
import hmac
import secrets
from dataclasses import dataclass
from enum import StrEnum

from volery.core.errors import BridgeError
from volery.core.network_access import check_address, check_token, shows_token


class Role(StrEnum):
    """Role of a client."""

    OPERATOR = "operator"
    """May do everything."""
    VIEWER = "viewer"
    """May subscribe, and call services that change nothing."""


@dataclass(frozen=True)
class Tokens:
    """Tokens that clients must send; without an operator's token all clients are operators."""

    operator: str | None = None
    viewer: str | None = None

    @property
    def needed(self) -> bool:
        """Whether clients need a token."""
        return self.operator is not None

    def role_of(self, given: str | None) -> Role | None:
        """Returns the role of a token; None: unknown token."""
        if self.operator is None:
            return Role.OPERATOR
        # compares both, so that the time does not show which one is similar
        operator = shows_token(given, self.operator)
        viewer = self.viewer is not None and shows_token(given, self.viewer)
        return Role.OPERATOR if operator else Role.VIEWER if viewer else None


def check_rights(host: str, tokens: Tokens, *, anywhere: bool) -> None:
    """Checks address and tokens of a server.

    anywhere: permission to listen beyond loopback. Raises BridgeError for an address beyond
    loopback without permission and token, or a viewers' token without a different operators' token.
    """
    check_address(host, anywhere=anywhere, flag="--allow-remote and --token")
    check_token(host, tokens.operator)
    if tokens.viewer is not None and (not tokens.needed or tokens.viewer == tokens.operator):
        raise BridgeError("--viewer-token needs a --token for operators, different from it")


class Sessions:
    """Signs tickets that browsers store as a cookie, so that images and downloads need no token.

    A ticket is valid for its role until this process ends; the server stores nothing for it.
    """

    def __init__(self) -> None:
        self._secret = secrets.token_bytes(32)

    def ticket(self, role: Role) -> str:
        """Returns a ticket for a client with the token of `role`."""
        return f"{role}-{hmac.new(self._secret, role.encode(), hashlib.sha256).hexdigest()}"

    def role_of(self, ticket: str | None) -> Role | None:
        """Returns the role of a ticket; None if it is invalid."""
        return next((role for role in Role if shows_token(ticket, self.ticket(role))), None)
