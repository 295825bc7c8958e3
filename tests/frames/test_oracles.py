"""The makers' own libraries read the encoders' frames as the decoder does (dev dependencies: all three are MIT)."""

from __future__ import annotations

import socket
import threading

import numpy as np
import pytest
from frames.encoders import CASES, G

from gyronorth.frames import decode


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in CASES if name.startswith("novatel")])
def test_novatel_edie_reads_the_same(name):
    oem = pytest.importorskip("novatel_edie.oem", reason="novatel-edie is not installed (extra dev)")
    case = CASES[name](80)
    parser = oem.Parser()
    samples, report = decode(b"".join(case.frames), case.protocol, case.options)
    logs = []
    for frame in case.frames:
        parser.write(frame)
        logs += [message.to_dict() for message in parser]
    assert len(logs) == len(samples)
    # EDIE gives the counts as sent: its y is the negated one
    gyro = np.array([(log["gyro_x"], -log["gyro_y"], log["gyro_z"]) for log in logs]) * 1e-9 * report.rate_hz
    accel = np.array([(log["accel_x"], -log["accel_y"], log["accel_z"]) for log in logs]) * 2e-8 * report.rate_hz
    assert samples.gyro == pytest.approx(gyro, rel=1e-12)
    assert samples.accel == pytest.approx(accel, rel=1e-12)
    assert samples.t == pytest.approx(np.array([log["gps_seconds"] for log in logs]) - logs[0]["gps_seconds"], abs=2e-6)


def test_advanced_navigation_reads_the_same():
    packets = pytest.importorskip(
        "advanced_navigation.anpp_packets.an_packet_28", reason="advanced-navigation is not installed (extra dev)"
    )
    from advanced_navigation.anpp_packets.an_packet_protocol import ANDecoder  # pyright: ignore[reportMissingImports]

    case = CASES["anpp"](80)
    data = b"\x01\x02noise".join(case.frames)
    decoder, read = ANDecoder(), []
    decoder.add_data(packet_bytes=data)
    while (packet := decoder.decode()) is not None:
        raw = packets.RawSensorsPacket()
        assert raw.decode(packet) == 0
        read.append((*raw.gyroscopes, *raw.accelerometers))
    samples, _ = decode(data, "anpp", case.options)
    assert samples.accel is not None
    assert np.array_equal(np.hstack((samples.gyro, samples.accel)), np.array(read))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["mip-scaled", "mip-delta"])
def test_mscl_reads_the_same(name):
    mscl = pytest.importorskip("mscl", reason="pymscl is not installed (extra dev)")
    case = CASES[name](80)
    listener = socket.create_server(("127.0.0.1", 0))
    listening, done = threading.Event(), threading.Event()

    def serve() -> None:
        with listener, listener.accept()[0] as connection:
            listening.wait(30)
            connection.sendall(b"".join(case.frames))
            done.wait(30)

    server = threading.Thread(target=serve, daemon=True)
    server.start()
    connection = mscl.Connection.TcpIp("127.0.0.1", listener.getsockname()[1])
    node, packets = mscl.InertialNode(connection), []
    listening.set()  # what comes before the node is made is lost to it
    for _ in range(100):
        packets += list(node.getDataPackets(200))
        if len(packets) == len(case.frames):
            break
    done.set()
    server.join()
    connection.disconnect()
    words = ("deltaTheta", "deltaVel") if name == "mip-delta" else ("scaledGyro", "scaledAccel")
    points = [{point.channelName(): point for point in packet.data()} for packet in packets]
    gyro, accel = (
        np.array([[point[f"{word}{axis}"].as_float() for axis in "XYZ"] for point in points]) for word in words
    )
    samples, report = decode(b"".join(case.frames), "mip")
    factor = report.rate_hz if name == "mip-delta" and report.rate_hz else 1.0
    assert samples.gyro == pytest.approx(gyro * factor, rel=1e-6)
    assert samples.accel == pytest.approx(accel * factor * G, rel=1e-6)
