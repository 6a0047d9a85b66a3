"""What keeps other web pages and other machines out: checked for every request, before anything is answered.

A page elsewhere may send requests to this machine, and may give its own name this machine's address (DNS rebinding).
So the ``Host`` asked for must be a name of ours; what changes something must come from our own page, with the secret
that only this page was told; and our page may load nothing from elsewhere (its ``Content-Security-Policy``).
"""

from __future__ import annotations

import ipaddress
import secrets
from urllib.parse import urlsplit

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import JSONResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

SECRET_HEADER = "x-scenarionet-secret"  # noqa: S105  # its name, not the secret

_HEADERS = {
    "content-security-policy": (
        "default-src 'self'; object-src 'none'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    ),
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "cross-origin-resource-policy": "same-origin",
    "cross-origin-opener-policy": "same-origin",
}


class Guard:
    """Refuses requests that are not for us, or not from our page; adds the headers that bind our page.

    Args:
        app: What answers the others.
        names: Host names that we go by, beside ``localhost`` and plain addresses.
        secret: What requests that change something must bring.
    """

    def __init__(self, app: ASGIApp, names: frozenset[str], secret: str) -> None:
        self._app = app
        self._names = names | {"localhost"}
        self._secret = secret

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer one request."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return

        async def send_bound(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                for name, value in _HEADERS.items():
                    headers[name] = value
            await send(message)

        reason = self._refusal(scope["method"], Headers(scope=scope))
        answer = JSONResponse({"error": reason}, 403) if reason else self._app
        await answer(scope, receive, send_bound)

    def _refusal(self, method: str, headers: Headers) -> str | None:
        """Why a request is refused; None when it is not."""
        if not self._is_ours(headers.get("host", "")):
            return "this server does not go by that name; open the address that `scenarionet browse` printed"
        if method in ("GET", "HEAD"):
            return None
        origin = headers.get("origin", "")
        if urlsplit(origin).netloc != headers["host"]:
            return "only this server's own page may change something"
        if not secrets.compare_digest(headers.get(SECRET_HEADER, "").encode(), self._secret.encode()):
            return "the page is of an earlier run of the server; load it again"
        return None

    def _is_ours(self, host: str) -> bool:
        """Whether the host asked for is ours. An address is: rebinding needs a name."""
        try:
            name = urlsplit(f"//{host}").hostname or ""
        except ValueError:
            return False
        return name in self._names or _is_address(name)


def _is_address(name: str) -> bool:
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True
