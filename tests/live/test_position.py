"""The latitude of a receiver: sentences that hold, and all others."""

from __future__ import annotations

from functools import reduce
from math import degrees, radians
from threading import Event

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from live_stream import Played, seconds, timed_rows
from pynmeagps import GET, NMEAMessage

from gyronorth.live.events import Bytes, Connected, Ended, Lost
from gyronorth.live.position import Position, latitude_of
from gyronorth.live.session import LiveSettings, Session
from gyronorth.live.status import NO_FIX
from gyronorth.readers import ReadOptions

GGA = b"$GPGGA,092204.999,4250.5589,S,14718.5084,E,1,04,24.4,19.7,M,,,,0000*1F\r\n"


@settings(deadline=None, max_examples=100)
@given(
    latitude=st.floats(-90, 90),
    kind=st.sampled_from(["GGA", "RMC"]),
    talker=st.sampled_from(["GP", "GN", "GL", "GA", "GB", "GI", "GQ"]),
)
def test_sentences_of_another_program_are_read(latitude, kind, talker):
    fields = {"lat": latitude, "NS": "N" if latitude >= 0 else "S", "lon": 12.5, "EW": "E"}
    extra = {"quality": 1} if kind == "GGA" else {"status": "A"}
    line = NMEAMessage(talker, kind, GET, **fields, **extra).serialize()
    found = latitude_of(line)
    assert found is not None
    assert degrees(found) == pytest.approx(latitude, abs=1e-5)


@pytest.mark.parametrize(
    "line",
    [
        GGA.replace(b"E,1,", b"E,0,"),  # no fix; its checksum does not hold either
        GGA.replace(b"*1F", b"*1E"),
        GGA.replace(b"4250", b"4350"),
        b"$GPGGA,,,,,,0,00,,,M,,M,,*66\r\n",
        b"$GPRMC,,V,,,,,,,,,,N*53\r\n",
        b"$GPGSV,3,1,11*00\r\n",
        b"\x00\xff$GPGGA",
    ],
)
def test_no_fix_no_latitude(line):
    assert latitude_of(line) is None


@pytest.mark.parametrize(
    ("body", "known"),
    [
        ("GNGGA,092204.999,4250.5589,S,14718.5084,E,2,04,24.4,19.7,M,,,,0000", True),
        ("GNGGA,092204.999,4250.5589,S,14718.5084,E,8,04,24.4,19.7,M,,,,0000", False),  # a simulator
        ("GLRMC,092204.999,A,4250.5589,S,14718.5084,E,0.0,89.68,211200,,,A", True),
        ("GLRMC,092204.999,A,4250.5589,S,14718.5084,E,0.0,89.68,211200,,,S", False),
        ("GLRMC,092204.999,V,4250.5589,S,14718.5084,E,0.0,89.68,211200,,,A", False),
        ("GLRMC,092204.999,A,4250.5589,S,14718.5084,E,0.0,89.68,211200,,", True),  # before 2001: without a mode
    ],
)
def test_what_a_receiver_calls_a_fix(body, known):
    total = reduce(lambda total, byte: total ^ byte, body.encode(), 0)
    assert (latitude_of(f"${body}*{total:02X}\r\n".encode()) is not None) is known


@settings(deadline=None, max_examples=300)
@given(data=st.binary(max_size=80), place=st.integers(0, len(GGA) - 6), byte=st.integers(0, 255))
def test_noise_gives_nothing(data, place, byte):
    assert latitude_of(data) is None
    changed = GGA[:place] + bytes([byte]) + GGA[place + 1 :]
    assert latitude_of(changed) in (None, latitude_of(GGA))


class Receiver:
    name, live = "receiver", True

    def run(self, emit, stop: Event) -> None:
        emit(Connected())
        emit(Bytes(GGA[30:] + GGA[:20]))
        emit(Lost("unplugged"))
        emit(Bytes(GGA[20:]))
        assert stop.is_set() is False
        emit(Bytes(GGA[:33]))
        emit(Bytes(GGA[33:]))
        emit(Ended())


def test_a_fix_is_waited_for():
    position = Position(Receiver())
    assert not position.wait(0)
    position.start()
    assert position.wait(300)
    assert position.latitude == pytest.approx(-radians(42 + 50.5589 / 60))


class Late:
    """A receiver whose fix comes when it is asked for."""

    name, live = "late", True

    def __init__(self) -> None:
        self.asked = Event()

    def run(self, emit, stop: Event) -> None:
        self.asked.wait(300)
        emit(Bytes(GGA))


def test_commands_are_obeyed_while_a_fix_is_waited_for():
    receiver = Late()
    asked = LiveSettings(ReadOptions(), method="mean", position=Position(receiver))
    session = Session(Played(timed_rows(seconds(0, 5))), asked)
    session.start()
    session.command("stop")
    session.saved()  # every command before it is done
    assert (session.status.state, session.status.trouble) == ("stopped", f"{NO_FIX} from late")
    receiver.asked.set()
    assert session.ended.wait(300)
    session.close()
