"""The server of a session, in a thread of its own: the addresses for programs and, where it is wanted, the page."""

from __future__ import annotations

import asyncio
import json
import socket
from collections.abc import AsyncIterator, Iterator
from contextlib import suppress
from math import radians
from pathlib import Path
from threading import Thread
from typing import Any
from urllib.parse import quote, urlencode

import uvicorn
from fastapi import FastAPI, WebSocket, WebSocketDisconnect
from fastapi.responses import HTMLResponse, JSONResponse, PlainTextResponse, Response, StreamingResponse
from uvicorn.protocols.http.auto import AutoHTTPProtocol

from gyronorth.errors import InputError
from gyronorth.live.access import Access, Crowd, is_loopback
from gyronorth.live.metrics import CONTENT_TYPE, metrics_text
from gyronorth.live.reporting import report_text
from gyronorth.live.session import Session
from gyronorth.live.status import UNATTENDED

#: For programs: whether the instrument works, and the heading as `live --json` prints it.
HEALTH_URL, HEADING_URL, STREAM_URL, METRICS_URL = "/healthz", "/api/heading", "/api/stream", "/metrics"
#: The same stream for web sockets, and where the alignment offset is set.
SOCKET_URL, ALIGNMENT_URL = "/api/socket", "/api/alignment"
#: Where the files of a session can be had.
RECORDING_URL, REPORT_URL = "/recording", "/report"
#: The stream is sent so often, Hz, unless the address says otherwise, and at most.
STREAM_HZ, FASTEST_HZ = 1.0, 20.0
#: A connection must have asked for something after so long, s; of those that have not, so many may wait.
HEADER_TIME, MOST_WAITING = 10.0, 200
#: Bytes of a message that is taken from a web socket: those of the page are small.
LARGEST_MESSAGE = 1 << 18


_Http: Any = AutoHTTPProtocol  # of the two that uvicorn has, the one that is installed


class Impatient(_Http):
    """HTTP that closes connections which ask for nothing: the oldest where they are many, each after a while.

    That is so too after an answer: what comes of the next request may stop in the middle.
    """

    def connection_made(self, transport: Any) -> None:
        """Take a connection."""
        super().connection_made(transport)
        self.opened = self.loop.time()
        waiting = [other for other in self.connections if isinstance(other, Impatient) and other.asks_nothing]
        if len(waiting) > MOST_WAITING:
            min(waiting, key=lambda other: other.opened).transport.close()
        self.loop.call_later(HEADER_TIME, self._look, None)

    @property
    def asks_nothing(self) -> bool:
        """Whether no request has come whole, or none since the last answer; a web socket has another protocol."""
        return (self.cycle is None or self.cycle.response_complete) and self.transport.get_protocol() is self

    def _look(self, before: Any) -> None:
        """Close it if it asked for nothing since `before`, its last request at the last look."""
        if self.transport.is_closing() or self.transport.get_protocol() is not self:
            return
        if self.asks_nothing and self.cycle is before:
            self.transport.close()
        else:
            self.loop.call_later(HEADER_TIME, self._look, self.cycle)


class Server:
    """Serves one session on a socket that listens already; without `page` for programs only, and without NiceGUI."""

    def __init__(
        self, session: Session, listener: socket.socket, *, host: str, token: str | None, page: bool = True
    ) -> None:
        self._socket = listener
        shown = f"[{host}]" if ":" in host else host
        query = f"/?{urlencode({'token': token})}" if token else "/"
        self.url = f"http://{shown}:{self._socket.getsockname()[1]}{query}"
        app = _application(session)
        if page:
            from gyronorth.live.page import attach

            attach(app, session)
        config = uvicorn.Config(
            Access(
                Crowd(app, streams={STREAM_URL, SOCKET_URL}),
                token=token or None,
                loopback=is_loopback(host),
                port=self._socket.getsockname()[1],
            ),
            log_level="warning",
            access_log=False,
            timeout_graceful_shutdown=1,
            http=Impatient,
            ws_max_size=LARGEST_MESSAGE,
        )
        self._server = uvicorn.Server(config)
        self._thread = Thread(target=self._server.run, args=([self._socket],), name="page", daemon=True)

    @property
    def failed(self) -> bool:
        """Whether the server ended by itself."""
        return not self._thread.is_alive()

    def start(self) -> None:
        """Begin to serve."""
        self._thread.start()

    def close(self) -> None:
        """Serve no more."""
        self._server.should_exit = True
        self._thread.join(timeout=5)
        self._socket.close()


def _application(session: Session) -> FastAPI:
    app = FastAPI(docs_url=None, redoc_url=None, openapi_url=None)

    @app.get(RECORDING_URL)
    def recording() -> Response:
        path = session.status.recording
        if path is None or not path.is_file():
            why = "no good row has come yet" if session.status.saving else "start with --save FILE.csv"
            return PlainTextResponse(f"There is no recording: {why}.", status_code=404)
        return StreamingResponse(
            _whole_lines(path),
            media_type="text/csv",
            headers={"content-disposition": f"attachment; filename*=UTF-8''{quote(path.name)}"},
        )

    @app.get(REPORT_URL)
    def report() -> Response:
        text = report_text(session.status, session.settings)
        if text is None:
            return PlainTextResponse("There is no heading yet, so there is no report.", status_code=404)
        return HTMLResponse(text)

    @app.get(HEALTH_URL)
    def health() -> Response:
        troubles = health_troubles(session)
        return JSONResponse({"ok": not troubles, "troubles": troubles}, status_code=503 if troubles else 200)

    @app.get(HEADING_URL)
    def heading() -> Response:
        return JSONResponse(session.status.to_json())

    @app.get(METRICS_URL)
    def metrics() -> Response:
        return Response(metrics_text(session.status), media_type=CONTENT_TYPE)

    _serve_streams(app, session)

    @app.post(ALIGNMENT_URL)
    def alignment(deg: float) -> Response:
        try:
            session.align(radians(deg))
        except InputError as error:
            return PlainTextResponse(str(error), status_code=422)
        return JSONResponse({"alignment_deg": deg})

    return app


def _serve_streams(app: FastAPI, session: Session) -> None:
    """The object of `live --json` again and again, as server-sent events and over a web socket."""

    @app.get(STREAM_URL)
    def stream(hz: float = STREAM_HZ) -> Response:
        if not 0 < hz <= FASTEST_HZ:
            return PlainTextResponse(f"hz is {hz:g}; above 0 and at most {FASTEST_HZ:g} is expected.", status_code=422)
        return StreamingResponse(
            _events(session, hz), media_type="text/event-stream", headers={"cache-control": "no-store"}
        )

    @app.websocket(SOCKET_URL)
    async def sockets(socket: WebSocket, hz: float = STREAM_HZ) -> None:
        if not 0 < hz <= FASTEST_HZ:
            await socket.close(1008)
            return
        await socket.accept()
        with suppress(WebSocketDisconnect, RuntimeError):  # the listener has gone
            async for document in _documents(session, hz):
                await socket.send_text(document)
            await socket.close()


async def _events(session: Session, hz: float) -> AsyncIterator[str]:
    """The object of `live --json` as server-sent events."""
    async for document in _documents(session, hz):
        yield f"data: {document}\n\n"


async def _documents(session: Session, hz: float) -> AsyncIterator[str]:
    """The object of `live --json`, for as long as somebody listens and the session runs."""
    while True:
        over = session.ended.is_set()
        yield json.dumps(session.status.to_json(), allow_nan=False)
        if over:
            return
        await asyncio.sleep(1 / hz)


def health_troubles(session: Session) -> list[str]:
    """What keeps the instrument from working, in words; empty where nothing does."""
    status = session.status
    troubles = [status.trouble] if status.trouble else []
    if status.state in ("stopped", "ended", "failed"):
        troubles.append(f"the session is {status.state}")
    if status.unattended > UNATTENDED:
        troubles.append(f"the session has not looked at its source for {status.unattended:.0f} s")
    if status.recording_error is not None:
        troubles.append(f"the recording is incomplete: {status.recording_error}")
    return troubles


def _whole_lines(path: Path) -> Iterator[bytes]:
    """The file as it is now, up to its last line end; what is appended meanwhile is left out."""
    with path.open("rb") as file:
        left = file.seek(0, 2)
        file.seek(0)
        held = b""
        while left > 0 and (piece := file.read(min(left, 1 << 16))):
            left -= len(piece)
            lines, end, rest = (held + piece).rpartition(b"\n")
            held = rest
            yield lines + end
