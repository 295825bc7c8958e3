"""What each protocol says by itself: units, ranges, status bits, times; real frames where there are some."""

from __future__ import annotations

import struct
from dataclasses import replace

import numpy as np
import pytest
from frames import encoders
from frames.encoders import CASES, G

from gyronorth.earth import EARTH_RATE
from gyronorth.errors import InputError
from gyronorth.frames import FrameStream, Report, Samples, StreamOptions, decode, recognise
from gyronorth.frames.catalogue import PROTOCOLS
from gyronorth.frames.framing import Framer
from gyronorth.frames.protocols import kvh, stim
from gyronorth.frames.protocols.novatel import IMU_TYPES
from gyronorth.frames.registry import protocol_of


def codes(report: Report) -> set[str]:
    return {finding.code for finding in report.findings}


def run(case: encoders.Case, options: StreamOptions | None = None, data: bytes | None = None) -> tuple[Samples, Report]:
    data = case.preamble + b"".join(case.frames) if data is None else data
    return decode(data, case.protocol, options or case.options)


def test_the_table_of_protocols_is_true():
    """Clock, counter and usual rate as the table says, for the case of each that shows the most."""
    seen = {info.name: set() for info in PROTOCOLS}
    for make in CASES.values():
        case = make(80)
        report = run(case)[1]
        seen[case.protocol].add((report.clock, report.lost_from))
        info = next(info for info in PROTOCOLS if info.name == case.protocol)
        assert report.axes == info.axes
    for info in PROTOCOLS:
        clocks, ways = {clock for clock, _ in seen[info.name]}, {way for _, way in seen[info.name]}
        assert ("unit's clock" in clocks) == info.time, info.name
        assert ("counter" in ways) == info.counter, info.name


# STIM


def stim_body(gyro: tuple[int, int, int], status: int = 0, counter: int = 0, ident: int = 0x91) -> bytes:
    pack = b"".join(value.to_bytes(3, "big", signed=True) for value in gyro)
    force = b"".join(value.to_bytes(3, "big", signed=True) for value in (0, 0, -(2**19)))
    return encoders.stim_datagram(
        bytes((ident,)) + pack + bytes((status,)) + force + b"\0" + bytes((counter,)) + b"\0\1"
    )


@pytest.mark.parametrize(("range_g", "bits"), [(5, 20), (10, 19), (30, 18), (80, 16)])
def test_stim_without_configuration_takes_the_range_from_gravity(range_g, bits):
    frames = []
    for i in range(80):
        force = b"".join(int(value).to_bytes(3, "big", signed=True) for value in (0, 0, -(2**bits)))
        frames.append(encoders.stim_datagram(b"\x91" + bytes(10) + force + b"\0" + bytes((i,)) + b"\0\1"))
    samples, report = decode(b"".join(frames), "stim", StreamOptions(rate_hz=125.0))
    assert samples.accel == pytest.approx(np.tile([0, 0, -G], (80, 1)))
    assert codes(report) == {"units_assumed", "range_assumed"}
    assert f"{range_g} g, by the size of gravity" in " ".join(finding.message for finding in report.findings)


def test_stim_without_configuration_and_gravity_takes_10_g_and_tells_it():
    frames = [encoders.stim_datagram(b"\x91" + bytes(20) + bytes((i,)) + b"\0\1") for i in range(80)]
    _, report = decode(b"".join(frames), "stim")
    assert "taken as 10 g, no range" in " ".join(finding.message for finding in report.findings)
    assert report.rate_hz is None


def test_stim_declared_increments_need_a_rate():
    frames = b"".join(stim_body((1, 2, 3), counter=i) for i in range(80))
    with pytest.raises(InputError, match="--rate HZ"):
        decode(frames, "stim", StreamOptions(increments="gyro", accel_range_g=10))
    samples, report = decode(frames, "stim", StreamOptions(increments="gyro", accel_range_g=10, rate_hz=125.0))
    assert samples.gyro[0] == pytest.approx(np.radians(np.array([1, 2, 3]) * 2.0**-21 * 125))
    assert not report.findings


@pytest.mark.parametrize(
    ("status", "saturated", "fault"),
    [(0x00, False, False), (0x11, True, False), (0x09, False, True), (0x80, False, True), (0x40, False, True)],
)
def test_stim_status(status, saturated, fault):
    frames = b"".join(stim_body((1, 2, 3), status if i == 70 else 0, i) for i in range(80))
    samples, report = decode(frames, "stim", StreamOptions(rate_hz=125.0))
    assert samples.saturated[70] == saturated
    assert samples.sensor_fault[70] == fault
    assert (report.saturated, report.sensor_fault) == (saturated, fault)


def test_stim_configuration_in_the_middle_counts_from_there():
    case = encoders.stim(200)
    again = encoders.stim_configuration(2, 0, 0, 0b0000)  # 10 g: one count is half as much
    samples, report = run(case, data=case.preamble + b"".join(case.frames[:150]) + again + b"".join(case.frames[150:]))
    assert samples.accel is not None
    assert samples.accel[:150] == pytest.approx(case.accel[:150])
    assert samples.accel[150:] == pytest.approx(case.accel[150:] / 2)
    assert codes(report) == {"configuration_changed"}


def test_stim_integrated_angle_is_refused():
    with pytest.raises(InputError, match="integrated angle"):
        run(encoders.stim(80), data=encoders.stim_configuration(2, 3, 0, 4) + b"".join(encoders.stim(80).frames))


@pytest.mark.parametrize("ident", sorted(stim.PARTS))
def test_every_stim_datagram_is_found(ident):
    frames = []
    for i in range(80):
        body = bytearray(bytes((ident,)) + bytes(stim.size_of(ident) - 1))
        body[1:4], body[-3] = (2**14).to_bytes(3, "big"), i
        frames.append(encoders.stim_datagram(bytes(body)))
    samples, report = decode(b"".join(frames), options=StreamOptions(rate_hz=125.0))
    assert report.protocol == "stim"
    assert samples.gyro == pytest.approx(np.tile([np.radians(1.0), 0, 0], (80, 1)))
    assert (samples.temperature is not None) == ("t" in stim.PARTS[ident])


def test_a_counter_that_moves_by_four_counts_one_sample():
    samples, report = run(encoders.stim(300))
    assert np.array_equal(np.diff(samples.number), np.ones(299))
    assert report.lost == 0


# KVH: two real frames, from the test data of the driver TRECVT/ros_kvh1750


REAL_EARLY = bytes.fromhex(
    "FE81FF55 3B041F78 B9B96613 BA234B38 BB7C0410 B8DEF480 3F7F4B7B 701F001D F12FB6EE".replace(" ", "")
)
REAL_VALID = bytes.fromhex(
    "FE81FF55 B3D0BBE7 32193EF4 30AC19A5 BA8F78D6 3A290594 3F7ECBD4 7768001D ADC5F651".replace(" ", "")
)


def test_the_real_kvh_frames_are_whole_and_say_what_the_driver_reads():
    frames = Framer(kvh.PROTOCOL).feed(b"\x00" + REAL_EARLY + REAL_VALID, last=True)
    assert len(frames) == 2
    fields = kvh.PROTOCOL.fields(frames.rows(np.array([0, 1])), 0x55)
    assert fields.counter is not None
    assert fields.counter.tolist() == [31, 104]
    assert fields.fault is not None
    assert fields.fault.tolist() == [True, False]
    assert fields.temperature is not None
    assert fields.temperature.tolist() == [29, 29]
    assert fields.accel is not None
    assert np.linalg.norm(fields.accel, axis=1) == pytest.approx([1.0, 1.0], abs=0.005)
    assert 1e-8 < np.linalg.norm(fields.gyro[1]) < 2e-7  # an angle per sample of Earth rate at 1 kHz, in rad


@pytest.mark.parametrize("unit", ["rad/s", "deg/s"])
@pytest.mark.parametrize("increments", [True, False])
def test_kvh_unit_is_told_by_earth_rate(unit, increments):
    case = encoders.kvh(200, increments=False)
    factor = (1.0 if unit == "rad/s" else np.degrees(1.0)) / (1000.0 if increments else 1.0)
    frames = []
    for i, frame in enumerate(case.frames):
        body = frame[:4] + (case.gyro[i] * factor).astype(">f4").tobytes() + frame[16:-4]
        frames.append(body + encoders.crc32_msb(body).to_bytes(4, "big"))
    samples, report = decode(b"".join(frames), "kvh")
    assert samples.gyro == pytest.approx(case.gyro, rel=1e-6)
    assert codes(report) == {"units_assumed", "rate_assumed"}
    assert "taken as 1000 Hz" in report.findings[0].message
    assert "only choice" in report.findings[1].message


def test_kvh_that_turns_is_taken_as_it_leaves_the_factory_and_told():
    case = encoders.kvh(200, increments=False)
    body = case.frames[0][:4] + np.full(3, 1e-2, ">f4").tobytes() + case.frames[0][16:-4]
    data = (body + encoders.crc32_msb(body).to_bytes(4, "big")) * 80
    samples, report = decode(data, "kvh", StreamOptions(rate_hz=100.0))
    assert samples.gyro[0] == pytest.approx(np.full(3, 1.0), rel=1e-6)
    assert "leaves the factory" in report.findings[0].message


def test_kvh_time_since_the_pulse_restarts_each_second():
    case = encoders.kvh(2500, form="B")
    frames = []
    for i, frame in enumerate(case.frames):
        body = frame[:28] + struct.pack(">I", 1000 * (i % 1000)) + frame[32:-4]
        frames.append(body + encoders.crc32_msb(body).to_bytes(4, "big"))
    samples, report = run(replace(case, frames=frames))
    assert samples.t == pytest.approx(np.arange(2500) / 1000.0)
    assert (report.clock_jumps, report.lost) == (2, 0)


# NovAtel


def test_novatel_negated_y_and_z_first_are_undone():
    six = (3, -2, 1, 30, -20, 10)  # z, -y, x of velocity, then of angle
    lines = [
        encoders.novatel_text_frame(f"%RAWIMUSXA,2300,{i}.0;00,8,2300,{i / 200:.9f},00000000,{','.join(map(str, six))}")
        for i in range(80)
    ]
    samples, report = decode(b"".join(lines))
    assert samples.gyro[0] == pytest.approx(np.array([10, 20, 30]) * 2.0**-19 * 200)
    assert samples.accel is not None
    assert samples.accel[0] == pytest.approx(np.array([1, 2, 3]) * 2.0**-14 * 200)
    assert (report.protocol, report.imu, report.rate_hz, report.axes) == ("novatel", "LN200", 200.0, "rfu")


def test_novatel_stamps_beat_the_rate_of_the_table_and_the_conflict_is_told():
    case = encoders.novatel(100, rate=400.0)
    samples, report = run(case)
    assert samples.gyro == pytest.approx(case.gyro)
    assert (report.rate_hz, report.rate_from) == (400.0, "unit's clock")
    assert codes(report) == {"rate_conflict"}
    assert "400 Hz (unit's clock), but 200 Hz (usual for the unit)" in report.findings[0].message


def test_novatel_without_imu_type_says_what_to_declare():
    with pytest.raises(InputError, match="do not name the IMU"):
        run(encoders.novatel(80, log="RAWIMUS"), StreamOptions())
    unknown = "%RAWIMUSXA,2300,1.0;00,99,2300,{}.0,00000000,1,2,3,4,5,6"
    with pytest.raises(InputError, match="IMU type 99"):
        decode(b"".join(encoders.novatel_text_frame(unknown.format(i)) for i in range(9)), "novatel")


def test_novatel_encrypted_frames_are_left_out_and_errors_marked():
    lines = [
        encoders.novatel_text_frame(f"%RAWIMUSXA,2300,1.0;{info},26,2300,{i / 200:.9f},00000000,1,2,3,4,5,6")
        for i, info in enumerate(["00"] * 40 + ["01"] * 20 + ["02"] * 20)
    ]
    samples, report = decode(b"".join(lines), "novatel")
    assert (len(samples), report.unusable, report.sensor_fault) == (60, 20, 20)
    assert samples.sensor_fault.tolist() == [False] * 40 + [True] * 20


def test_novatel_profiles_are_shipped():
    from gyronorth.sensor import read_sensor

    for imu in IMU_TYPES:
        if imu.profile:
            assert read_sensor(imu.profile).name == imu.profile


# The others


def test_sbg_status_and_high_scale():
    def frame(i: int, status: int) -> bytes:
        return encoders.sbg_frame(
            44, struct.pack("<IH6ih", 5000 * i, status, 0, 0, -10269082, 12304174, 0, 0, 256 * 20)
        )

    data = b"".join(frame(i, {70: 0x05FF, 71: 0x07DF}.get(i, 0x07FF)) for i in range(80))
    samples, _ = decode(data, "sbg")
    assert samples.gyro[:, 0] == pytest.approx(np.ones(80))
    assert np.flatnonzero(samples.saturated).tolist() == [70]
    assert np.flatnonzero(samples.sensor_fault).tolist() == [71]
    assert samples.temperature == pytest.approx(np.full(80, 20.0))


def test_vectornav_takes_the_filtered_rate_only_where_there_is_no_other():
    case = encoders.vectornav(80)
    frames = [encoders.vectornav_frame(1, (0x0021,), frame[6:26]) for frame in case.frames]
    samples, _ = decode(b"".join(frames), "vectornav")
    assert samples.gyro == pytest.approx(np.full((80, 3), 0.5))
    both = b"".join(frame + other for frame, other in zip(case.frames, frames, strict=True))
    samples, report = decode(both, "vectornav")
    assert samples.gyro == pytest.approx(case.gyro)
    assert report.other == 80


def test_vectornav_saturation():
    frames = [
        encoders.vectornav_frame(4, (0x0808,), struct.pack("<3fH", 0.1, 0.2, 0.3, 0x40 if i == 5 else 0x1))
        for i in range(80)
    ]
    samples, _ = decode(b"".join(frames), "vectornav", StreamOptions(rate_hz=100.0))
    assert np.flatnonzero(samples.saturated).tolist() == [5]
    assert samples.accel is None


def test_mip_overrange_and_gps_time():
    frames = [
        encoders.mip_frame(
            [
                (0x12, struct.pack(">dHH", 604799.5 + i / 100 if i < 50 else i / 100 - 0.5, 2300 + (i >= 50), 7)),
                (0x05, struct.pack(">3f", 1, 2, 3)),
                (0x18, struct.pack(">H", 0x0010 if i == 7 else 0)),
            ]
        )
        for i in range(100)
    ]
    samples, report = decode(b"".join(frames), "mip")
    assert np.flatnonzero(samples.saturated).tolist() == [7]
    assert samples.t == pytest.approx(np.arange(100) / 100)
    assert (report.rate_hz, report.clock_jumps) == (100.0, 0)


def test_xbus_clipping_and_double_length():
    blocks = [(0x8020, struct.pack(">3f", 1, 2, 3)), (0x7010, bytes(200)), (0x7020, bytes(200))]
    frames = [encoders.xbus_frame([*blocks, (0xE020, struct.pack(">I", 0x800 if i == 9 else 0))]) for i in range(80)]
    samples, report = decode(b"".join(frames), "xbus", StreamOptions(rate_hz=100.0))
    assert np.flatnonzero(samples.saturated).tolist() == [9]
    assert samples.gyro[0].tolist() == [1, 2, 3]
    assert report.axes == "flu"


def test_xbus_dq_of_a_fast_turn_is_an_angle_not_its_sine():
    rate, half = 2.0, 2.0 / 10 / 2
    dq = struct.pack(">4d", np.cos(half), 0, 0, np.sin(half))
    frames = [encoders.xbus_frame([(0x1060, struct.pack(">I", 1000 * i)), (0x8033, dq)]) for i in range(80)]
    samples, _ = decode(b"".join(frames), "xbus")
    assert samples.gyro[:, 2] == pytest.approx(np.full(80, rate), rel=1e-12)


def test_inertial_labs_status():
    def frame(i: int, status: int, second: int) -> bytes:
        data = struct.pack("<I6iHH", 5 * i, 0, 0, 10**6, 100, 0, 0, status, second)
        return encoders.inertial_labs_frame(bytes((0x01, 0x23, 0x21, 0x53, 0x5A)), data)

    words = {3: (0x0400, 0), 5: (0x1000, 0), 7: (0, 0x0004), 9: (0x0004, 0), 11: (0x0002, 0), 13: (0x0051, 0x0008)}
    data = b"".join(frame(i, *words.get(i, (0x0080, 0))) for i in range(80))
    samples, _ = decode(data, "inertial-labs")
    assert np.flatnonzero(samples.saturated).tolist() == [3, 5, 7]
    assert np.flatnonzero(samples.sensor_fault).tolist() == [9, 11]


def test_anello_real_line_is_whole_and_refused():
    real = b"#APIMU,318214.937,0.0344,-0.0128,1.0077,-0.0817,0.0013,-0.0038,0.01051,0.0000,318214.548,47.0547*55\r\n"
    assert len(Framer(protocol_of("anello")).feed(real, last=True)) == 1
    assert recognise(real * 10) == "anello"
    with pytest.raises(InputError, match="one optical gyro"):
        decode(real * 10)


@pytest.mark.parametrize("sync", ["", "0.000,"])
def test_anello_m1_lines_have_no_odometer(sync):
    def lines(optical: str) -> bytes:
        return b"".join(
            encoders.xor_line(f"#APIM1,{10 * i:.3f},{sync}0.01,0.02,1.00{i % 7},0.1,0.2,0.3,{optical},44.1")
            for i in range(80)
        )

    with pytest.raises(InputError, match="one optical gyro"):
        decode(lines("0.001234"))
    if sync:
        samples, report = decode(lines("0.001234,-0.002345,0.003456"))
        assert (report.protocol, report.rate_hz, len(samples)) == ("anello", 100.0, 80)
        assert samples.gyro[3] == pytest.approx(np.radians([0.001234, -0.002345, 0.003456]))
        assert samples.temperature[5] == 44.1


def test_anello_x3_range_and_status():
    def frame(i: int, rate: int, status: int) -> bytes:
        payload = struct.pack("<QQ3h3h3i3hhHHBBB", 5_000_000 * i, 0, 0, 0, -4096, 1, 2, 3, rate, 0, 0, 4, 5, 6, 2500,
                              8 << 11 | 400, 200, 0, status, 0)  # fmt: skip
        return encoders.x3_frame(253, payload)

    data = b"".join(frame(i, 2_000_000_000 if i == 3 else 4178, int(i == 4)) for i in range(80))
    samples, _ = decode(data, "anello-x3")
    assert np.flatnonzero(samples.saturated).tolist() == [3]
    assert np.flatnonzero(samples.sensor_fault).tolist() == [4]
    assert samples.accel is not None
    assert samples.accel[0] == pytest.approx([0, 0, -G])
    assert samples.gyro[0, 0] == pytest.approx(np.radians(4178e-7), rel=1e-12)
    assert samples.gyro[0, 0] < EARTH_RATE


def test_hg4930_control_messages_alone_are_taken():
    head = struct.pack("<6hHH", 100, -200, 300, 0, 0, -1000, 0x80F0, 0)
    data = encoders.sum16_frame(b"\x0e\x01" + head) * 80
    samples, report = decode(data, "hg4930")
    assert samples.gyro[0] == pytest.approx(np.array([100, -200, 300]) * 2.0**-20 * 600)
    assert samples.accel is not None
    assert samples.accel[0, 2] == pytest.approx(-1000 * 2.0**-14 * 0.3048 * 600)
    assert report.rate_hz == 600.0


def test_a_rate_that_is_only_usual_and_that_gravity_contradicts_is_asked():
    case = encoders.hg4930(200, rate=600.0)
    with pytest.raises(InputError, match=r"at 600 Hz it is.*pass --rate 600, or --rate 100 if it is not"):
        run(case, StreamOptions())
    samples, report = run(case, StreamOptions(rate_hz=600.0))
    assert samples.accel == pytest.approx(case.accel, abs=case.accel_step)
    assert report.rate_hz == 600.0
    samples, report = run(case, StreamOptions(rate_hz=100.0))
    assert samples.accel == pytest.approx(case.accel / 6, abs=case.accel_step)
    assert codes(run(encoders.hg4930(200))[1]) == {"rate_assumed"}


def test_numbers_that_are_not_finite_are_left_out():
    values = np.full(12, np.nan, "<f4")
    good = encoders.anpp(80).frames
    bad = encoders.anpp_frame(28, values.tobytes())
    samples, report = decode(b"".join(good[:70]) + bad + b"".join(good[70:]), "anpp", StreamOptions(rate_hz=100.0))
    assert (len(samples), report.unusable) == (80, 1)
    assert samples.number.tolist() == [*range(70), *range(71, 81)]


def test_a_declared_rate_that_the_clock_contradicts_is_told():
    case = encoders.sbg(100)
    _, report = run(case, StreamOptions(rate_hz=100.0))
    assert report.rate_hz == 200.0
    assert "but 100 Hz (declared)" in report.findings[0].message


@pytest.mark.slow
def test_a_unit_that_is_set_anew_is_told_once():
    frames = encoders.stim(200).frames
    other = [stim_body((1, 2, 3), counter=i & 0xFF) for i in range(300)]
    stream = FrameStream("stim", StreamOptions(rate_hz=500.0))
    for frame in [*frames, *other]:
        stream.feed(frame)
    report = stream.report
    assert [finding.code for finding in report.findings].count("layout_changed") == 1
    assert (report.samples, report.other, report.settings) == (437, 63, 1)


def test_a_stream_ends_before_enough_frames():
    stream = FrameStream("sbg")
    assert stream.feed(encoders.sbg(2).frames[0]) is None
    assert stream.finish() is None
    assert stream.report.other == 1


@pytest.mark.parametrize("units", [(4, 0), (5, 5), (0, 6)])
def test_output_units_of_stim_that_are_not_known_are_asked(units):
    case = encoders.stim(200)
    data = encoders.stim_configuration(2, units[0], units[1], 0b0100) + b"".join(case.frames)
    with pytest.raises(InputError, match=r"(?s)output unit 1.*--increments"):
        decode(data)
    samples, report = decode(data, options=StreamOptions(increments="none"))
    assert samples.gyro == pytest.approx(case.gyro)
    assert report.rate_hz == case.rate_hz


@pytest.mark.parametrize(("declared", "told"), [(500.0, []), (None, ["rate_conflict"]), (400.0, ["rate_conflict"])])
def test_usual_rate_says_nothing_against_a_clock_that_agrees_with_a_declaration(declared, told):
    case = encoders.kvh(300, form="B", rate=1000.0)
    frames = [kvh_at(frame, 2000 * i) for i, frame in enumerate(case.frames)]
    _, report = decode(b"".join(frames), options=StreamOptions(rate_hz=declared, gyro_unit="rad/s", increments="gyro"))
    assert report.rate_hz == 500.0
    assert [finding.code for finding in report.findings] == told


def kvh_at(frame: bytes, time_us: int) -> bytes:
    body = frame[:28] + time_us.to_bytes(4, "big") + frame[32:-4]
    return body + encoders.crc32_msb(body).to_bytes(4, "big")
