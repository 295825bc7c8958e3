"""Who may open the page: anyone on this machine, and elsewhere whoever knows the token.

Every request and every web socket passes here. The token comes once in the address,
`?token=...`, and is then a cookie; it is compared in constant time.
"""

from __future__ import annotations

import hashlib
import hmac
import ipaddress
import secrets
from http.cookies import CookieError, SimpleCookie
from typing import Any
from urllib.parse import parse_qsl, urlencode, urlsplit

from gyronorth.errors import InputError

COOKIE = "gyronorth_live"
_REFUSED = (
    "<!DOCTYPE html><html lang=en><meta name=viewport content='width=device-width'><title>gyronorth live</title>"
    "<body style='font:1rem/1.5 system-ui;margin:2rem'><h1>401: a token is needed</h1>"
    "<p>Open the page with the token that the command was given: <code>?token=...</code> behind its address.</p>"
)


def is_loopback(host: str) -> bool:
    """Whether only this machine can reach a server that listens there."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def check_access(host: str, token: str | None) -> None:
    """Refuse to serve other machines without a token.

    Raises
    ------
    InputError
        If the page could be reached from elsewhere and there is no token.
    """
    if not is_loopback(host) and not token:
        raise InputError(
            f"--host {host}: the page could be reached from other machines. Pass --token TEXT (or set "
            "GYRONORTH_TOKEN), which whoever opens the page must know."
        )


class Access:
    """ASGI middleware that lets through what may pass."""

    def __init__(self, app: Any, *, token: str | None, loopback: bool) -> None:
        self._app, self._token, self._loopback = app, token, loopback
        # Not the token itself: a cookie of one run is of no use in the next.
        self._cookie = secrets.token_urlsafe(32)

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        """Pass a request on, or answer that it may not pass."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        headers = {name.decode("latin-1").lower(): value.decode("latin-1") for name, value in scope["headers"]}
        if not self._same_site(headers):
            await _refuse(scope, receive, send, 403, "<h1>403: another site</h1>")
        elif self._token is None or _equal(_cookie(headers), self._cookie):
            await self._app(scope, receive, send)
        else:
            await self._without_cookie(scope, receive, send)

    async def _without_cookie(self, scope: Any, receive: Any, send: Any) -> None:
        query = parse_qsl(scope["query_string"].decode("latin-1"), keep_blank_values=True)
        given = next((value for name, value in query if name == "token"), "")
        if scope["type"] == "websocket" or not _equal(given, self._token or ""):
            await _refuse(scope, receive, send, 401, _REFUSED)
            return
        rest = urlencode([(name, value) for name, value in query if name != "token"])
        target = scope["path"] + (f"?{rest}" if rest else "")
        cookie = f"{COOKIE}={self._cookie}; Path=/; HttpOnly; SameSite=Lax"
        headers = [(b"location", target.encode("latin-1", "replace")), (b"set-cookie", cookie.encode())]
        await _answer(send, 303, headers, b"")

    def _same_site(self, headers: dict[str, str]) -> bool:
        """Not asked by the page of another site, nor under a name that points here from elsewhere."""
        host = headers.get("host", "")
        if self._loopback and not is_loopback(urlsplit(f"//{host}").hostname or ""):
            return False
        origin = headers.get("origin")
        return origin is None or urlsplit(origin).netloc == host


def _equal(given: str, wanted: str) -> bool:
    """Compare in constant time, whatever the lengths."""
    digests = (hashlib.sha256(text.encode("utf-8", "replace")).digest() for text in (given, wanted))
    return hmac.compare_digest(*digests)


def _cookie(headers: dict[str, str]) -> str:
    try:
        morsel = SimpleCookie(headers.get("cookie", "")).get(COOKIE)
    except CookieError:
        return ""
    return morsel.value if morsel else ""


async def _refuse(scope: Any, receive: Any, send: Any, code: int, text: str) -> None:
    if scope["type"] == "websocket":
        await receive()
        await send({"type": "websocket.close", "code": 1008})
        return
    await _answer(send, code, [(b"content-type", b"text/html; charset=utf-8")], text.encode())


async def _answer(send: Any, code: int, headers: list[tuple[bytes, bytes]], body: bytes) -> None:
    await send({"type": "http.response.start", "status": code, "headers": [*headers, (b"cache-control", b"no-store")]})
    await send({"type": "http.response.body", "body": body})
