"""Who may see the page and who may move the rig.

No cookie is ever set: the token travels in the printed address, then in a header
that only our own page's script adds, so a forged request from another site
carries no right at all. Host and Origin are checked besides (DNS rebinding).
"""

from __future__ import annotations

import hashlib
import hmac
import ipaddress
import os
import secrets
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from urllib.parse import urlsplit

from eddyscan.core.errors import InputError

OPERATOR, VIEWER = "operator", "viewer"
LEAST_PASSWORD = 8
MAX_WRONG = 5
LOCKED_S = 30.0
MAX_SESSIONS = 64


@dataclass
class Access:
    """Tokens and the checks of every request.

    Attributes
    ----------
    host, port : where the page listens
    password : needed by everybody who is not on this computer; None on the loopback
    """

    host: str
    port: int
    password: str | None = None
    now: Callable[[], float] = time.monotonic
    operator_token: str = field(default_factory=lambda: secrets.token_urlsafe(24))
    viewer_token: str = field(default_factory=lambda: secrets.token_urlsafe(24))

    def __post_init__(self) -> None:
        self._salt = os.urandom(16)
        self._digest = None if self.password is None else self._derived(self.password)
        self.password = None
        self._sessions: list[str] = []
        self._wrong: list[float] = []

    def role_of(self, token: str | None, peer: str) -> str | None:
        """Return the role a token gives to a peer's address, or None."""
        if not token:
            return None
        if _same(token, self.viewer_token):
            return VIEWER
        if any(_same(token, session) for session in self._sessions):
            return OPERATOR
        if _same(token, self.operator_token) and (self._digest is None or is_loopback(peer)):
            return OPERATOR
        return None

    @property
    def asks_password(self) -> bool:
        """Tell whether there is a password to log in with."""
        return self._digest is not None

    def login(self, password: str) -> str | None:
        """Return a new operator token for the right password; None when wrong or locked.

        After MAX_WRONG wrong ones within LOCKED_S seconds nobody gets in for a while.
        """
        now = self.now()
        self._wrong = [when for when in self._wrong if now - when < LOCKED_S]
        if self._digest is None or len(self._wrong) >= MAX_WRONG:
            return None
        if not hmac.compare_digest(self._derived(password), self._digest):
            self._wrong.append(now)
            return None
        self._sessions = [*self._sessions[-(MAX_SESSIONS - 1) :], secrets.token_urlsafe(24)]
        return self._sessions[-1]

    def host_allowed(self, host: str | None) -> bool:
        """Tell whether a Host header names this page: a number or this computer, never a foreign name."""
        name = _name_of(host)
        if name is None:
            return False
        if name == "localhost" or is_loopback(name) or name == self.host.lower():
            return True
        return self._digest is not None and _is_address(name)

    def origin_allowed(self, origin: str | None, host: str | None) -> bool:
        """Tell whether a request comes from our own page, or from no page at all."""
        if origin is None:
            return True
        return urlsplit(origin).scheme in ("http", "https") and urlsplit(origin).netloc.lower() == (host or "").lower()

    def address(self, role: str = OPERATOR) -> str:
        """Return the address to print, token included."""
        token = self.operator_token if role == OPERATOR else self.viewer_token
        shown = "127.0.0.1" if self.host in ("", "0.0.0.0", "::") else self.host
        return f"http://{f'[{shown}]' if ':' in shown else shown}:{self.port}/?token={token}"

    def _derived(self, password: str) -> bytes:
        return hashlib.scrypt(password.encode(), salt=self._salt, n=1 << 12, r=8, p=1)


def checked_listening(host: str, password: str | None) -> None:
    """Raise InputError when `host` is reachable from outside and no good password is set."""
    if is_loopback(host) or host == "localhost":
        return
    if password is None:
        raise InputError(
            f"--host {host} opens the page, and with it the rig, to the network, and no password is set. "
            "Set the variable EDDYSCAN_PASSWORD or give --ask-password, or leave --host out to stay on this computer."
        )
    if len(password) < LEAST_PASSWORD:
        raise InputError(
            f"the password for --host {host} has {len(password)} characters, needed are {LEAST_PASSWORD} or more. "
            "Choose a longer one."
        )


def is_loopback(address: str) -> bool:
    """Tell whether an address is this computer's own."""
    try:
        return ipaddress.ip_address(address.split("%")[0]).is_loopback
    except ValueError:
        return False


def _is_address(name: str) -> bool:
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True


def _name_of(host: str | None) -> str | None:
    try:
        return urlsplit(f"//{host}").hostname if host else None
    except ValueError:
        return None


def _same(given: str, known: str) -> bool:
    return hmac.compare_digest(given.encode(), known.encode())
