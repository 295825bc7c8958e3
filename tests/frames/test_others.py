"""Units that are set to send other messages than raw rates: told by name, with what to switch on."""

from __future__ import annotations

import collections
import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from frames import encoders

from gyronorth.errors import InputError
from gyronorth.frames import FrameStream, decode
from gyronorth.live.reader import StreamReader
from gyronorth.readers.options import ReadOptions
from gyronorth.readers.registry import open_source

RNG = np.random.default_rng(3)
#: What units of the listed families send by default: name, frames, what the message must name.
SENT: dict[str, tuple[Callable[[int], bytes], str, str]] = {
    "anpp": (lambda _: encoders.anpp_frame(20, RNG.bytes(100)), r"packet 20 \(system state\)", "packet 28"),
    "sbg": (lambda i: encoders.sbg_frame(6 + i % 3, RNG.bytes(40)), r"log 6 \(EKF_EULER\)", "IMU_SHORT"),
    "mip": (lambda _: encoders.mip_frame([(5, RNG.bytes(16))], 0x82), r"set 0x82 \(filter\)", "set 0x80"),
    "xbus": (
        lambda i: encoders.xbus_frame([(0x1020, struct.pack(">H", i)), (0x2030, RNG.bytes(12))]),
        "PacketCounter, EulerAngles",
        "RateOfTurn",
    ),
    "novatel": (
        lambda i: encoders.novatel_text_frame(f"%INSPVASA,2300,{i}.000;2300,{i}.0,51.1,-114.0,1000.0,0,0,0,1,2,3,GOOD"),
        "log INSPVASA",
        "RAWIMUSX",
    ),
    "vectornav": (
        lambda i: encoders.xor_line(
            f"$VNYMR,+100.9,-010.{i % 9},+001.0,+0.1,+0.2,+0.3,-09.7,+00.2,+00.0,-0.1,+0.2,-0.3"
        ),
        r"\$VNYMR",
        "UncompGyro",
    ),
    "anello": (lambda i: encoders.xor_line(f"#APINS,{i},1,2,37.1,-122.0,10.0,1,2,3,0,0,90.0,0"), "#APINS", "#APIMU"),
}
UNIT = pytest.mark.parametrize("name", list(SENT))


@pytest.mark.slow
@UNIT
def test_capture_without_raw_rates_names_what_it_holds_and_what_to_switch_on(name, tmp_path: Path):
    frame, held, needed = SENT[name]
    data = b"".join(frame(i) for i in range(60))
    expected = rf"(?s){held}.*no raw rates.*{needed}"
    with pytest.raises(InputError, match=expected):
        decode(data)
    file = tmp_path / "unit.bin"
    file.write_bytes(data)
    with pytest.raises(InputError, match=expected):
        open_source(file, ReadOptions())
    with pytest.raises(InputError, match=expected):
        open_source(file, ReadOptions(protocol=name))


@pytest.mark.slow
@UNIT
def test_live_names_it_too_within_a_few_seconds(name):
    frame, held, needed = SENT[name]
    reader = StreamReader("serial:/dev/ttyUSB0", ReadOptions())
    with pytest.raises(InputError, match=rf"(?s){held}.*{needed}"):
        collections.deque((reader.push(frame(i)) for i in range(300)), maxlen=0)


def test_other_messages_before_the_data_are_no_reason_to_refuse():
    case = encoders.anpp(300)
    data = b"".join(encoders.anpp_frame(20, RNG.bytes(100)) for _ in range(30)) + b"".join(case.frames)
    samples, report = decode(data)
    assert (len(samples), report.other) == (300, 30)
    reader = StreamReader("a unit", ReadOptions())
    rows = [len(batch.rows) for at in range(0, len(data), 50) for batch in reader.push(data[at : at + 50])]
    rows += [len(batch.rows) for batch in reader.end()]
    assert sum(rows) == 300


def test_memory_does_not_grow_with_messages_that_are_not_read():
    stream = FrameStream("anpp")
    for _ in range(50):
        stream.feed(encoders.anpp_frame(20, RNG.bytes(100)) * 20)
    assert len(stream.pending) < 100
    assert stream.report.other == 1000
