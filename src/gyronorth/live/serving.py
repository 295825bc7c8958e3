"""The server of the page, in a thread of its own."""

from __future__ import annotations

import socket
from threading import Thread
from urllib.parse import urlencode

import uvicorn
from fastapi import FastAPI
from fastapi.responses import FileResponse, HTMLResponse, PlainTextResponse, Response
from nicegui import ui

from gyronorth.live import page
from gyronorth.live.access import Access, is_loopback
from gyronorth.live.reporting import report_text
from gyronorth.live.session import Session


class PageServer:
    """Serves the page of one session on a socket that listens already."""

    def __init__(self, session: Session, listener: socket.socket, *, host: str, token: str | None) -> None:
        self._socket = listener
        shown = f"[{host}]" if ":" in host else host
        query = f"/?{urlencode({'token': token})}" if token else "/"
        self.url = f"http://{shown}:{self._socket.getsockname()[1]}{query}"
        app = _application(session)
        config = uvicorn.Config(
            Access(app, token=token or None, loopback=is_loopback(host)),
            log_level="warning",
            access_log=False,
            timeout_graceful_shutdown=1,
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

    @app.get(page.RECORDING_URL)
    def recording() -> Response:
        path = session.status.recording
        if path is None or not path.is_file():
            why = "no good row has come yet" if session.status.saving else "start with --save FILE.csv"
            return PlainTextResponse(f"There is no recording: {why}.", status_code=404)
        return FileResponse(path, filename=path.name, media_type="text/csv")

    @app.get(page.REPORT_URL)
    def report() -> Response:
        text = report_text(session.status, session.settings)
        if text is None:
            return PlainTextResponse("There is no heading yet, so there is no report.", status_code=404)
        return HTMLResponse(text)

    ui.run_with(
        app,
        root=lambda: page.build(session),
        title="gyronorth live",
        dark=None,
        language="en-GB",
        favicon="🧭",
        tailwind=False,
        show_welcome_message=False,
    )
    return app
