"""Protection against requests from other web pages and other machines; checked for every request.

A foreign page can send requests to this machine, and can resolve its own name to this machine's address (DNS
rebinding). Therefore the ``Host`` header must be a known name or an IP address. A request that reads costs work, so it
must not come from another page, as far as browsers say so; one that changes something must come from our own page and
carry its secret. A ``Content-Security-Policy`` keeps our page from loading anything from elsewhere.
"""

from __future__ import annotations

import ipaddress
import secrets
from contextlib import suppress
from urllib.parse import urlsplit

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import JSONResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from scenarionet_data.errors import ScenarioNetError

SECRET_HEADER = "x-scenarionet-secret"  # noqa: S105  # the name of the header

MAX_BODY = 10**6
"""Maximum size of a request's body [bytes]."""

_HEADERS = {
    "content-security-policy": (
        "default-src 'self'; object-src 'none'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    ),
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "cross-origin-resource-policy": "same-origin",
    "cross-origin-opener-policy": "same-origin",
}


class BodyTooLarge(ScenarioNetError):
    """A request's body exceeds :data:`MAX_BODY`."""

    def __init__(self) -> None:
        super().__init__(f"the request's body is larger than {MAX_BODY / 1e6:g} MB; use a shorter condition")


class Guard:
    """Middleware that rejects foreign and large requests and adds security headers to responses.

    Args:
        app: The protected application.
        names: Accepted host names, besides ``localhost`` and IP addresses.
        secret: Token required of requests that change something.
    """

    def __init__(self, app: ASGIApp, names: frozenset[str], secret: str) -> None:
        self._app = app
        self._names = names | {"localhost"}
        self._secret = secret

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Handle one request."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return

        async def send_with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                for name, value in _HEADERS.items():
                    headers[name] = value
            await send(message)

        num_received = 0

        async def receive_limited() -> Message:
            nonlocal num_received
            message = await receive()
            num_received += len(message.get("body", b""))
            if num_received > MAX_BODY:
                raise BodyTooLarge
            return message

        reason = self._refusal(scope["method"], scope["path"], Headers(scope=scope))
        answer = JSONResponse({"error": reason}, 403) if reason else self._app
        await answer(scope, receive_limited, send_with_headers)

    def _refusal(self, method: str, path: str, headers: Headers) -> str | None:
        """Reason to reject a request, None to accept it."""
        if not self._is_accepted(headers.get("host", "")):
            return "unknown host name; open the address that `scenarionet browse` printed"
        if method in ("GET", "HEAD"):
            is_own = headers.get("sec-fetch-site", "none") in ("same-origin", "none")  # none: typed, or no browser
            is_link = path == "/" and headers.get("sec-fetch-dest") == "document"
            return None if is_own or is_link else "only this server's own page may read"
        origin = headers.get("origin", "")
        if urlsplit(origin).netloc != headers["host"]:
            return "only this server's own page may save"
        if not secrets.compare_digest(headers.get(SECRET_HEADER, "").encode(), self._secret.encode()):
            return "the server was restarted; reload the page"
        return None

    def _is_accepted(self, host: str) -> bool:
        """Whether a host is accepted. IP addresses always are, because DNS rebinding needs a name."""
        with suppress(ValueError):
            name = urlsplit(f"//{host}").hostname or ""
            return name in self._names or bool(ipaddress.ip_address(name))
        return False
