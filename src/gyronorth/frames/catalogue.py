"""The protocols that can be decoded, as plain data: for help texts, messages and the documentation.

It imports nothing heavy. How a protocol is decoded stands in `gyronorth.frames.protocols`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True)
class ProtocolInfo:
    """One protocol, and what its frames say by themselves."""

    name: str
    title: str
    units: str  # the units behind it
    form: Literal["binary", "text", "binary and text"]
    module: str  # where its `PROTOCOL` stands
    time: bool = False  # the frames carry the unit's time
    counter: bool = False  # the frames carry a sequence counter
    usual_rate_hz: float | None = None  # rate taken where nothing else tells it
    axes: str | None = None  # where x, y and z of the data point, as `--axes`; None: as marked on the unit
    declare: str = ""  # what the user must declare, and when
    output: str = ""  # what the unit must be set to send


PROTOCOLS: tuple[ProtocolInfo, ...] = (
    ProtocolInfo(
        "stim",
        "Sensonor/Safran STIM datagrams",
        "STIM300, STIM318, STIM320, STIM380H, STIM202, STIM210, STIM277H",
        "binary",
        "stim",
        counter=True,
        declare="rate; accelerometer range and output unit, where no configuration datagram was captured",
        output="normal mode, with datagrams that hold angular rate (0x90 to 0xA7)",
    ),
    ProtocolInfo(
        "novatel",
        "NovAtel RAWIMU, RAWIMUS, RAWIMUX, RAWIMUSX",
        "ISA-100C, LN-200, HG1700, HG1900, HG1930, HG4930, STIM300, KVH 1750, uIMU behind an OEM receiver",
        "binary and text",
        "novatel",
        time=True,
        axes="rfu",
        declare="IMU type for RAWIMU and RAWIMUS",
        output="the log RAWIMUSX (`LOG RAWIMUSXB ONNEW`)",
    ),
    ProtocolInfo(
        "kvh",
        "KVH formats A, B and C",
        "KVH/EMCORE 1725, 1750, 1760, 1775, P-series",
        "binary",
        "kvh",
        time=True,
        counter=True,
        declare="rate for formats A and C; unit and increments, where the rate at rest does not tell them",
        output="format A, B or C",
    ),
    ProtocolInfo(
        "hg4930",
        "Honeywell HG4930 and HG1120 serial messages",
        "HG4930, HG1120",
        "binary",
        "honeywell",
        usual_rate_hz=100.0,
        declare="axes",
        output="the inertial message 0x02",
    ),
    ProtocolInfo(
        "sbg",
        "SBG Systems sbgECom IMU_SHORT, IMU_DATA",
        "Ekinox, Apogee, Navsight, Quanta, Pulse",
        "binary",
        "sbg",
        time=True,
        axes="frd",
        output="the log IMU_SHORT (44) or IMU_DATA (3)",
    ),
    ProtocolInfo(
        "anpp",
        "Advanced Navigation ANPP packet 28",
        "Boreas, Certus, Motus",
        "binary",
        "anpp",
        axes="frd",
        declare="rate",
        output="packet 28 (raw sensors), at a fixed rate",
    ),
    ProtocolInfo(
        "vectornav",
        "VectorNav binary output",
        "VN-110, VN-210, VN-310 and the smaller ones",
        "binary",
        "vectornav",
        time=True,
        axes="frd",
        declare="rate, where the output holds neither TimeStartup nor DeltaTheta",
        output="a binary output with DeltaTheta and DeltaVel, or UncompGyro and UncompAccel, and TimeStartup",
    ),
    ProtocolInfo(
        "vectornav-ascii",
        "VectorNav $VNIMU",
        "VN-110, VN-210, VN-310 and the smaller ones",
        "text",
        "vectornav_ascii",
        axes="frd",
        declare="rate",
        output="$VNIMU (`$VNWRG,06,19*XX`), or a binary output with DeltaTheta, DeltaVel and TimeStartup",
    ),
    ProtocolInfo(
        "mip",
        "MicroStrain MIP sensor data",
        "3DM-CV7, 3DM-GQ7 and their relatives",
        "binary",
        "mip",
        time=True,
        axes="frd",
        declare="rate, where the packets hold no time",
        output="sensor data (set 0x80) with delta theta, delta velocity and the reference time (0x07, 0x08, 0xD5)",
    ),
    ProtocolInfo(
        "xbus",
        "Xsens Xbus MTData2",
        "MTi-600, MTi-680, Sirius and the smaller ones",
        "binary",
        "xbus",
        time=True,
        counter=True,
        axes="flu",
        declare="rate, where the packets hold no SampleTimeFine",
        output="MTData2 with RateOfTurn and Acceleration, or DeltaQ and DeltaV, and SampleTimeFine",
    ),
    ProtocolInfo(
        "inertial-labs",
        "Inertial Labs user-defined data",
        "IMU-P, MRU, INS families",
        "binary",
        "inertial_labs",
        time=True,
        axes="rfu",
        declare="rate, where the data hold no time",
        output="user-defined data (0x95) with rate (0x21), specific force (0x23) and time (0x01)",
    ),
    ProtocolInfo(
        "anello",
        "ANELLO #APIMU, #APIM1",
        "ANELLO IMU+, EVK, GNSS INS",
        "text",
        "anello",
        time=True,
        declare="axes",
        output="#APIMU, or #APIM1 of a unit with three optical gyros",
    ),
    ProtocolInfo(
        "anello-x3",
        "ANELLO X3 binary",
        "ANELLO X3",
        "binary",
        "anello_x3",
        time=True,
        axes="frd",
        output="the IMU message (0xFD)",
    ),
)

NAMES = tuple(info.name for info in PROTOCOLS)


def protocol_info(name: str) -> ProtocolInfo:
    """The row of a protocol; KeyError for a name that is none."""
    for info in PROTOCOLS:
        if info.name == name:
            return info
    raise KeyError(name)
