"""gyronorth live: the heading of what a unit sends, on a page, as NMEA or as JSON lines, with its recording."""

from __future__ import annotations

import logging
import sys
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from gyronorth.catalogue import NMEA_SETS
from gyronorth.cli import completion
from gyronorth.cli.app import app
from gyronorth.cli.config import take_config
from gyronorth.cli.correction import AnySession, Deviation, GyroBias, curve_and_method
from gyronorth.cli.live_options import LEVELS, latitude_or_receiver, log_level_name, nmea_set_name
from gyronorth.cli.options import OUTPUT, SITE, MethodName, RequireSigma, SensorName
from gyronorth.cli.parsers import degrees, number
from gyronorth.cli.reading_options import with_reading

if TYPE_CHECKING:
    from gyronorth.live.nmea_out import NmeaOut
    from gyronorth.live.session import Session
    from gyronorth.live.status import Status
    from gyronorth.readers import ReadOptions

#: Options of reading that a line of a stream needs.
DECLARED = (
    "rate", "axes", "boresight", "gyro_unit", "accel_unit", "gyro_scale", "accel_scale", "columns",
    "protocol", "increments", "imu", "accel_range", "time_unit",
)  # fmt: skip
PAGE = "Page"
#: The counters are told so often, s, at the level "debug".
COUNTED = 10.0
log = logging.getLogger("gyronorth.live")
#: Whether the session is over is looked at so often, s.
LOOKS = 0.1


@app.command()
@partial(with_reading, only=DECLARED)
def live(
    source: Annotated[
        str,
        typer.Argument(
            metavar="SOURCE",
            help="A file to replay, - for standard input, tcp:HOST:PORT, udp:[HOST:]PORT, serial:DEV[:BAUD].",
        ),
    ],
    latitude: Annotated[
        Any,
        typer.Option(
            metavar="DEG|tcp:|udp:|serial:",
            parser=latitude_or_receiver,
            help="Geodetic latitude, north positive, or a receiver's stream of GGA or RMC; may come from the source.",
            rich_help_panel=SITE,
        ),
    ] = None,
    config: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.toml",
            callback=take_config,
            is_eager=True,
            help="Read options from a TOML file; the command line takes precedence.",
        ),
    ] = None,
    log_level: Annotated[
        str,
        typer.Option(
            metavar="|".join(LEVELS),
            parser=log_level_name,
            autocompletion=completion.offered(lambda: LEVELS),
            help="Log level on standard error.",
            rich_help_panel=OUTPUT,
        ),
    ] = "info",
    sensor: SensorName = None,
    method: MethodName = "auto",
    gyro_bias: GyroBias = None,
    deviation: Deviation = None,
    any_session: AnySession = False,
    speed: Annotated[
        Any,
        typer.Option(
            metavar="X", parser=number("a positive factor", "20", above=0), help="Replay speed factor of a file."
        ),
    ] = 1.0,
    save: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.csv",
            help="Record every valid line; an existing file is kept and a number added to the name.",
            rich_help_panel=OUTPUT,
        ),
    ] = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print one JSON object a line and nothing else.", rich_help_panel=OUTPUT)
    ] = False,
    nmea_out: Annotated[
        list[str] | None,
        typer.Option(
            metavar="tcp|udp:HOST:PORT|serial:DEV[:BAUD]",
            help="Serve (tcp) or send (udp, serial) NMEA 0183 sentences; may be given again for another target.",
            rich_help_panel=OUTPUT,
        ),
    ] = None,
    nmea_set: Annotated[
        str,
        typer.Option(
            metavar="|".join(NMEA_SETS),
            parser=nmea_set_name,
            autocompletion=completion.offered(lambda: NMEA_SETS),
            help="Which sentences: " + "; ".join(f"{name} {words}" for name, words in NMEA_SETS.items()) + ".",
            rich_help_panel=OUTPUT,
        ),
    ] = "standard",
    output_rate: Annotated[
        Any,
        typer.Option(
            metavar="HZ",
            parser=number("a rate of 0.01 to 100 Hz", "1", low=0.01, high=100),
            help="Rate of NMEA and JSON output.",
            rich_help_panel=OUTPUT,
        ),
    ] = 1.0,
    require_sigma: RequireSigma = None,
    alignment: Annotated[
        Any,
        typer.Option(
            metavar="DEG",
            parser=degrees("an angle of -180 to 180 degrees", "-1.5", low=-180, high=180),
            help="How far to starboard of the unit's forward axis the vehicle's lies; the page and /api/alignment set "
            "another.",
            rich_help_panel=SITE,
        ),
    ] = 0.0,
    page: Annotated[
        bool,
        typer.Option(
            "--page/--no-page", help="Serve the page; without it a replay ends with the file.", rich_help_panel=PAGE
        ),
    ] = True,
    api: Annotated[
        bool,
        typer.Option("--api", help="Serve the HTTP interface for programs without the page.", rich_help_panel=PAGE),
    ] = False,
    host: Annotated[
        str,
        typer.Option(
            metavar="HOST", help="Address to listen on; other than this machine needs --token.", rich_help_panel=PAGE
        ),
    ] = "127.0.0.1",
    port: Annotated[
        Any,
        typer.Option(
            metavar="PORT",
            parser=number("a port of 0 to 65535", "8080", low=0, high=65535),
            help="Port of the page; 0: any free port.",
            rich_help_panel=PAGE,
        ),
    ] = 8080,
    token: Annotated[
        str | None,
        typer.Option(metavar="TEXT", envvar="GYRONORTH_TOKEN", help="Access token of the page.", rich_help_panel=PAGE),
    ] = None,
    *,
    reading: ReadOptions,
) -> int:
    """Find the heading of a sensor that is still measuring, and show it.

    Ends with the source where there is no page, else when it is interrupted (Ctrl-C). Exit code 0: the last
    heading that was measured is valid. 2: bad input. 3: it is not; the reasons are printed.
    """
    from gyronorth.errors import InputError
    from gyronorth.live import nmea_out as nmea
    from gyronorth.live.binding import allow_descriptors
    from gyronorth.live.position import Position
    from gyronorth.live.recorder import check_place
    from gyronorth.live.session import LiveSettings, Session
    from gyronorth.live.sources import open_source
    from gyronorth.sensor import read_sensor

    if not log.handlers:
        log.addHandler(logging.StreamHandler())
    del config  # its values are those of the other options by now
    log.setLevel(log_level.upper())
    if save is not None:
        check_place(save)
    allow_descriptors()
    receiver = Position(open_source(latitude, reading, speed=1)) if isinstance(latitude, str) else None
    reading = replace(reading, latitude=None if receiver else latitude)
    opened = open_source(source, reading, speed=speed)
    if reading.latitude is None and receiver is None and source.startswith(("tcp:", "udp:", "serial:")):
        raise InputError(
            "The latitude is not known. Pass --latitude DEG (north positive); Earth rate cannot be read without it."
        )
    profile = None if sensor is None else read_sensor(sensor)
    biased = gyro_bias is not None
    curve, method = curve_and_method(deviation, method, reading, any_session=any_session, biased=biased)
    settings = LiveSettings(
        reading, profile, method, gyro_bias, curve, save, require_sigma,
        alignment=alignment, position=receiver, targets=tuple(nmea_out or ()),
    )  # fmt: skip
    session = Session(opened, settings)
    server = _server(session, host=host, port=int(port), token=token, page=page) if page or api else None
    outs = [
        nmea.NmeaOut(target, rate_hz=output_rate, status=lambda: session.status, kind=nmea_set)
        for target in map(nmea.parse_target, nmea_out or ())
    ]
    return _run(session, server, outs, as_json=as_json, interval=1 / output_rate, ends=not page)


def _server(session: Session, *, host: str, port: int, token: str | None, page: bool) -> Any:
    """The server, listening already."""
    import errno
    import socket

    from gyronorth.errors import InputError
    from gyronorth.live.access import check_access
    from gyronorth.live.binding import bound_socket

    check_access(host, token)
    try:
        listener = bound_socket(host, port, socket.SOCK_STREAM)
    except OSError as error:
        cure = "check --host"
        if error.errno in (errno.EADDRINUSE, errno.EACCES):
            cure = "choose another port with --port, or 0 for any free one"
        raise InputError(f"The page cannot listen on {host}:{port} ({error.strerror or error}): {cure}.") from None
    try:
        from gyronorth.live.serving import Server

        return Server(session, listener, host=host, token=token, page=page)
    except ImportError as error:
        listener.close()
        raise InputError(
            f"{'The page' if page else '--api'} needs {error.name}, which is not installed: pip install "
            f"'gyronorth[{'live' if page else 'api'}]', or {'pass --no-page' if page else 'leave it out'}."
        ) from None


def _run(session: Session, server: Any, outs: list[NmeaOut], *, as_json: bool, interval: float, ends: bool) -> int:
    """Until the source ends, or the user ends it."""
    import signal
    import time
    from threading import Event

    finish, due = Event(), time.monotonic() + interval
    before = {sign: signal.signal(sign, lambda *_: finish.set()) for sign in (signal.SIGINT, signal.SIGTERM)}
    said = ""
    session.start()
    for out in outs:
        out.start()
    if server is not None:
        server.start()
        print(f"{'api' if ends else 'page'}: {server.url}", file=sys.stderr, flush=True)
    counted = time.monotonic()
    try:
        while not finish.wait(min(interval, LOOKS)):
            said = _say(session, said)
            if as_json and time.monotonic() >= due:
                _print(session)
                due = max(due + interval, time.monotonic())
            if time.monotonic() - counted > COUNTED:
                counted = time.monotonic()
                log.debug("%s: %s", session.status.source, session.status.counters)
            if session.error is not None or (ends and session.ended.is_set()):
                break
            if server is not None and server.failed:
                break
    finally:
        session.close()
        for sign, handler in before.items():
            signal.signal(sign, handler)
        for out in outs:
            out.close()
        if server is not None:
            server.close()
    return _end(session, as_json=as_json)


def _say(session: Session, said: str) -> str:
    """Tell the terminal what happens to the source, once each."""
    status = session.status
    news = status.trouble or status.message
    if news and news not in (said, "connecting") and session.error is None:
        log.log(logging.WARNING if status.trouble else logging.INFO, "%s: %s", status.source, news)
    return news


def _print(session: Session) -> None:
    from gyronorth.cli.outputs import print_json

    print_json(session.status.to_json())
    sys.stdout.flush()


def _end(session: Session, *, as_json: bool) -> int:
    """The last word: the heading as `gyronorth heading` prints it."""
    from gyronorth.cli.heading_command import REFUSED, VALID
    from gyronorth.errors import InputError
    from gyronorth.report.tables import Outcome
    from gyronorth.report.terminal import print_heading

    if session.error is not None:
        raise session.error
    status = session.status
    estimate = status.measured
    if as_json:
        _print(session)
    elif estimate is None and not _misunderstood(status):
        print(" ".join([f"No heading: {_what_came(status)}", *(finding.message for finding in status.findings)]))
    elif estimate is not None:
        print_heading(Outcome(status.source, estimate, heading_true=status.heading_true), sys.stdout)
    if status.recording_error is not None:
        print(f"warning: the recording is incomplete. {status.recording_error}", file=sys.stderr)
    elif status.recording is not None:
        print(f"recording: {status.recording}", file=sys.stderr)
    elif status.saving:
        print("recording: no file was made, as no good row came.", file=sys.stderr)
    if _misunderstood(status):
        raise InputError(f"No heading: {_what_came(status)}")
    return VALID if estimate is not None and estimate.valid else REFUSED


def _rejected(status: Status) -> int:
    count = status.counters
    return count.garbage + count.implausible + count.strays


def _misunderstood(status: Status) -> bool:
    """Whether lines came and each was rejected: the source, or what was declared of it, is wrong."""
    return status.counters.good == 0 and 0 < status.counters.lines <= _rejected(status)


def _what_came(status: Status) -> str:
    """Why there is no heading, by the lines that came: how many, how many were rejected, and one of those."""
    count, source = status.counters, status.source
    if count.lines == 0:
        return f"no row came from {source}."
    why = [f"{count.garbage} could not be read, the last of them {status.last_garbage!r}"] if count.garbage else []
    why += [f"{count.implausible} hold values that no sensor gives"] if count.implausible else []
    why += [f"{count.strays} have time stamps that fit nowhere"] if count.strays else []
    rejected = f"{_rejected(status)} rejected" + (f": {', '.join(why)}" if why else "")
    text = f"of {count.lines} lines from {source} {count.good} were good rows and {rejected}."
    if not _misunderstood(status):
        return text
    if count.implausible:
        return f"{text} Check --gyro-unit and --accel-unit."
    return (
        f"{text} Frames of a known protocol are expected, or rows of numbers with commas between them, below a header "
        "such as t,w_x,w_y,w_z,f_x,f_y,f_z, or without one of 3, 4, 6 or 7 numbers; --columns declares others. Most "
        "likely this is not the output of the sensor, or comes at another baud rate."
    )
