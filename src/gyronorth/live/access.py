"""Who may open the page, anyone on this machine and elsewhere whoever knows the token; and how many at a time.

Every request and every web socket passes here. From a browser the token comes once in the address,
`?token=...`, and is then a cookie; a program sends it with each request, `Authorization: Bearer ...`.
It is compared in constant time, and wrong ones wait.
"""

from __future__ import annotations

import asyncio
import hashlib
import hmac
import ipaddress
import secrets
from collections import Counter
from collections.abc import Container
from http.cookies import CookieError, SimpleCookie
from typing import Any
from urllib.parse import parse_qsl, quote, urlencode, urlsplit

from gyronorth.errors import InputError

COOKIE = "gyronorth_live"
#: A token has at least so many characters: 64 bits, where each is one of 16.
SHORTEST = 16
#: An answer to a wrong token takes so long, s, and so many of them wait at a time; more are turned away.
DELAY, MOST_WAITING = 1.0, 20
#: Streams, and other requests and web sockets, that are answered at a time; more are turned away.
MOST_STREAMS, MOST_REQUESTS = 100, 400
#: What browsers are told with every answer. The page's own library writes scripts and styles into the page.
HEADERS = (
    (
        b"content-security-policy",
        b"default-src 'self'; script-src 'self' 'unsafe-inline' 'unsafe-eval'; style-src 'self' 'unsafe-inline'; "
        b"img-src 'self' data:; font-src 'self' data:; connect-src 'self'; object-src 'none'; base-uri 'self'; "
        b"form-action 'none'; frame-ancestors 'none'",
    ),
    (b"x-content-type-options", b"nosniff"),
    (b"x-frame-options", b"DENY"),
    (b"referrer-policy", b"no-referrer"),
)
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
        If the page could be reached from elsewhere and there is no token, or a token is easily guessed.
    """
    if token and (len(token) < SHORTEST or len(set(token)) < SHORTEST // 4):
        raise InputError(
            f"The token is too easily guessed: {SHORTEST} characters or more are needed, and not a few over and over. "
            'Example: --token "$(openssl rand -hex 16)".'
        )
    if not is_loopback(host) and not token:
        raise InputError(
            f"--host {host}: the page could be reached from other machines. Pass --token TEXT (or set "
            "GYRONORTH_TOKEN), which whoever opens the page must know."
        )


class Access:
    """ASGI middleware that lets through what may pass; `port` keeps the cookies of two pages of a machine apart."""

    def __init__(self, app: Any, *, token: str | None, loopback: bool, port: int) -> None:
        self._app, self._token, self._loopback = app, token, loopback
        self._cookie_name = f"{COOKIE}_{port}"
        self._refused = 0  # wrong tokens that are being answered
        # Not the token itself: a cookie of one run is of no use in the next.
        self._cookie = secrets.token_urlsafe(32)

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        """Pass a request on, or answer that it may not pass."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        send = _with_headers(send)
        headers = {name.decode("latin-1").lower(): value.decode("latin-1") for name, value in scope["headers"]}
        try:
            same_site = self._same_site(headers)
        except ValueError:  # a Host or Origin that is no address
            await _refuse(scope, receive, send, 400, "<h1>400: no such address</h1>")
            return
        if not same_site:
            await _refuse(scope, receive, send, 403, "<h1>403: another site</h1>")
        elif self._token is None or _equal(_cookie(headers, self._cookie_name), self._cookie):
            await self._app(scope, receive, send)
        elif bearer := _bearer(headers):
            answer = self._app if _equal(bearer, self._token) else self._wrong_token
            await answer(scope, receive, send)
        else:
            await self._without_cookie(scope, receive, send)

    async def _without_cookie(self, scope: Any, receive: Any, send: Any) -> None:
        query = parse_qsl(scope["query_string"].decode("latin-1"), keep_blank_values=True)
        given = next((value for name, value in query if name == "token"), "")
        if scope["type"] == "websocket" or not _equal(given, self._token or ""):
            if given:
                await self._wrong_token(scope, receive, send)
            else:
                await _refuse(scope, receive, send, 401, _REFUSED)
            return
        rest = urlencode([(name, value) for name, value in query if name != "token"])
        # One slash: a browser takes //name for another site, and a backslash for a slash.
        path = "/" + quote(scope["path"].lstrip("/\\"), safe="/")
        target = path + (f"?{rest}" if rest else "")
        cookie = f"{self._cookie_name}={self._cookie}; Path=/; HttpOnly; SameSite=Lax"
        headers = [(b"location", target.encode("ascii")), (b"set-cookie", cookie.encode())]
        await _answer(send, 303, headers, b"")

    async def _wrong_token(self, scope: Any, receive: Any, send: Any) -> None:
        """Answer late, so that tokens cannot be tried by the thousand."""
        if self._refused >= MOST_WAITING:
            await _refuse(scope, receive, send, 429, "<h1>429: too many wrong tokens</h1>")
            return
        self._refused += 1
        try:
            await asyncio.sleep(DELAY)
        finally:
            self._refused -= 1
        await _refuse(scope, receive, send, 401, _REFUSED)

    def _same_site(self, headers: dict[str, str]) -> bool:
        """Not asked by the page of another site, nor under a name that points here from elsewhere."""
        host = headers.get("host", "")
        parts = urlsplit(f"//{host}")
        if not parts.hostname or parts.netloc != host or "@" in host or any(c.isspace() for c in host):
            raise ValueError("Host is no address")
        _ = parts.port  # ValueError where it is no number
        if self._loopback and not is_loopback(parts.hostname):
            return False
        origin = headers.get("origin")
        return origin is None or urlsplit(origin).netloc == host


class Crowd:
    """ASGI middleware that answers so many requests at a time; those of `streams`, which never end, are fewer."""

    def __init__(self, app: Any, *, streams: Container[str]) -> None:
        self._app, self._streams = app, streams
        self._running: Counter[bool] = Counter()

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        """Pass a request on, or turn it away."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        endless = scope["path"] in self._streams
        if self._running[endless] >= (MOST_STREAMS if endless else MOST_REQUESTS):
            await _refuse(scope, receive, send, 503, "<h1>503: too many listen already</h1>")
            return
        self._running[endless] += 1
        try:
            await self._app(scope, receive, send)
        finally:
            self._running[endless] -= 1


def _equal(given: str, wanted: str) -> bool:
    """Compare in constant time, whatever the lengths."""
    digests = (hashlib.sha256(text.encode("utf-8", "replace")).digest() for text in (given, wanted))
    return hmac.compare_digest(*digests)


def _bearer(headers: dict[str, str]) -> str:
    scheme, _, token = headers.get("authorization", "").partition(" ")
    return token.strip() if scheme.lower() == "bearer" else ""


def _cookie(headers: dict[str, str], name: str) -> str:
    try:
        morsel = SimpleCookie(headers.get("cookie", "")).get(name)
    except CookieError:
        return ""
    return morsel.value if morsel else ""


def _with_headers(send: Any) -> Any:
    async def sending(message: Any) -> None:
        if message["type"] == "http.response.start":
            message = {**message, "headers": [*message.get("headers", ()), *HEADERS]}
        await send(message)

    return sending


async def _refuse(scope: Any, receive: Any, send: Any, code: int, text: str) -> None:
    if scope["type"] == "websocket":
        await receive()
        await send({"type": "websocket.close", "code": 1008})
        return
    await _answer(send, code, [(b"content-type", b"text/html; charset=utf-8")], text.encode())


async def _answer(send: Any, code: int, headers: list[tuple[bytes, bytes]], body: bytes) -> None:
    await send({"type": "http.response.start", "status": code, "headers": [*headers, (b"cache-control", b"no-store")]})
    await send({"type": "http.response.body", "body": body})
