"""Records of miniSEED."""

from __future__ import annotations

from itertools import permutations

import numpy as np
import pymseed
import pytest
from numpy.testing import assert_allclose

from gyronorth.errors import InputError
from gyronorth.readers import read

ROWS, RATE = 400, 100.0
LSB_RATE, LSB_FORCE = 1e-9, 1e-6
GYRO = np.random.default_rng(9).normal([3e-5, -4e-5, -5e-5], 1e-6, (ROWS, 3))
ACCEL = np.random.default_rng(10).normal([0.0, 0.0, -9.80665], 1e-3, (ROWS, 3))
START = pymseed.timestr2nstime("2024-03-01T11:58:00.25Z")
SI = {"gyro_unit": "rad/s", "accel_unit": "m/s2", "latitude": 0.8}
SCALES = {"gyro_scale": LSB_RATE, "accel_scale": LSB_FORCE}
#: East, north, up of forward-right-down, with forward to the north.
ENU = ("E", "N", "Z"), np.array([1, 0, 2]), np.array([1, 1, -1])


def counts(values, scale):
    return np.round(values / scale).astype(np.int32)


def channels(*, station="XX_ROT1_00", letters=ENU[0]):
    """Channel -> counts of a sensor of both kinds."""
    turned = GYRO[:, ENU[1]] * ENU[2], ACCEL[:, ENU[1]] * ENU[2]
    both = zip(("J", "N"), turned, (LSB_RATE, LSB_FORCE), strict=True)
    return {
        f"FDSN:{station}_H_{kind}_{letter}": counts(values[:, k], scale)
        for kind, values, scale in both
        for k, letter in enumerate(letters)
    }


def saved(path, sent, *, keep=None, late=None, encoding=pymseed.DataEncoding.STEIM2, version=2):
    traces = pymseed.MS3TraceList()
    for name, values in sent.items():
        for part in keep or [slice(0, ROWS)]:
            start = START + round(part.start / RATE * 1e9) + (late or {}).get(name, 0)
            traces.add_data(name, values[part], "i" if values.dtype.kind == "i" else "d", RATE, starttime=start)
    records = list(traces.generate(max_record_length=512, encoding=encoding, format_version=version))
    path.write_bytes(b"".join(records[::-1]))  # records may come in any order
    return path


@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("name", ["day.mseed", "XX.ROT1.00.2024.061"])
def test_six_channels_are_one_recording(tmp_path, version, name):
    recording = read(saved(tmp_path / name, channels(), version=version), **SI, **SCALES)
    assert recording.rate_hz == RATE
    assert recording.axes == "rfu"
    assert recording.axes_origin == "assumed"
    assert recording.start_time_utc == "2024-03-01T11:58:00.250000Z"
    assert_allclose(recording.gyro_b, GYRO, atol=0.51 * LSB_RATE)
    assert_allclose(recording.accel_b, ACCEL, atol=0.51 * LSB_FORCE)
    assert "gyro: HJE, HJN, HJZ of XX.ROT1.00" in recording.read_as


def test_floats_are_read_as_they_are(tmp_path):
    sent = {f"FDSN:XX_R__H_J_{k + 1}": GYRO[:, k].copy() for k in range(3)}
    path = saved(tmp_path / "rec.mseed", sent, encoding=pymseed.DataEncoding.FLOAT64)
    recording = read(path, gyro_unit="rad/s", axes="frd", latitude=0.8)
    assert recording.accel_b is None
    assert_allclose(recording.gyro_b, GYRO, rtol=1e-15)


@pytest.mark.parametrize("order", list(permutations("21Z"))[:3])
def test_the_components_and_not_their_order_say_the_axes(tmp_path, order):
    east_first = dict(zip("21Z", range(3), strict=True))
    turned = GYRO[:, ENU[1]] * ENU[2]
    sent = {f"FDSN:XX_R__H_J_{letter}": counts(turned[:, east_first[letter]], LSB_RATE) for letter in order}
    recording = read(saved(tmp_path / "rec.mseed", sent), gyro_unit="rad/s", gyro_scale=LSB_RATE, latitude=0.8)
    assert_allclose(recording.gyro_b, GYRO, atol=0.51 * LSB_RATE)


def test_a_gap_is_a_gap(tmp_path):
    path = saved(tmp_path / "rec.mseed", channels(), keep=[slice(0, 150), slice(170, ROWS)])
    recording = read(path, **SI, **SCALES)
    (gap,) = recording.gaps
    assert (len(recording.gyro_b), round(gap.start * RATE), gap.samples) == (ROWS, 150, 20)
    assert_allclose(recording.gyro_b[170:], GYRO[170:], atol=0.51 * LSB_RATE)


def test_rows_are_where_all_three_axes_have_samples(tmp_path):
    sent = channels()
    names = list(sent)
    path = saved(tmp_path / "rec.mseed", sent, late={names[1]: round(0.2e9 / RATE)})  # sampled a fifth later
    assert len(read(path, **SI, **SCALES).gyro_b) == ROWS
    path = saved(tmp_path / "rec.mseed", sent, late={names[1]: round(20e9 / RATE)})
    assert len(read(path, **SI, **SCALES).gyro_b) == ROWS - 20
    path = saved(tmp_path / "rec.mseed", sent, late={names[1]: round(3600e9)})
    with pytest.raises(InputError, match="have no sample at the same time"):
        read(path, **SI, **SCALES)


def test_whole_numbers_are_asked_for_their_size(tmp_path):
    with pytest.raises(InputError, match=r"as counts are[\s\S]*\nTry: .*--gyro-scale DEG_PER_S_IN_ONE_COUNT"):
        read(saved(tmp_path / "rec.mseed", channels()))


def test_two_stations_are_asked_for(tmp_path):
    path = saved(tmp_path / "rec.mseed", channels() | channels(station="XX_ROT2_00"))
    with pytest.raises(InputError, match=r"holds 2 rotational sensors: XX.ROT1.00, XX.ROT2.00.*\nTry: .*XX.ROT1.00$"):
        read(path, **SI, **SCALES)
    assert "XX.ROT2.00" in read(path, variable="XX.ROT2.00", **SI, **SCALES).read_as


def test_axes_of_two_kinds_are_not_put_together(tmp_path):
    sent = {name: values for name, values in channels().items() if "_N_" in name}
    sent |= {name: values for name, values in channels(letters="123").items() if "_J_" in name}
    path = saved(tmp_path / "rec.mseed", sent)
    with pytest.raises(InputError, match=r"which axes of the two are the same is not known.*\nTry: .*f_x=-,f_y=-"):
        read(path, **SI, **SCALES)
    columns = {"w_x": "HJ1", "w_y": "HJ2", "w_z": "HJ3", "f_x": "HNE", "f_y": "HNN", "f_z": "HNZ"}
    recording = read(path, columns=columns, axes="rfu", **SI, **SCALES)
    assert_allclose(recording.accel_b, ACCEL, atol=0.51 * LSB_FORCE)


@pytest.mark.parametrize(
    ("sent", "message"),
    [
        (lambda: dict(list(channels().items())[:2]), "HJE, HJN; three channels of rotation rate"),
        (lambda: {"FDSN:XX_R__H_H_Z": counts(GYRO[:, 0], LSB_RATE)}, r"cat [*].mseed > all.mseed"),
    ],
)
def test_too_few_channels_are_told(tmp_path, sent, message):
    with pytest.raises(InputError, match=message):
        read(saved(tmp_path / "rec.mseed", sent()), **SI)


def test_samples_that_are_there_twice_are_refused(tmp_path):
    path = saved(tmp_path / "rec.mseed", channels(), keep=[slice(0, 200), slice(150, ROWS)])
    with pytest.raises(InputError, match=r"Records of channel HJE of rec.mseed overlap at 2024-03-01T11:58:01"):
        read(path, **SI, **SCALES)


def test_a_damaged_file_is_one_error(tmp_path):
    path = saved(tmp_path / "rec.mseed", channels())
    path.write_bytes(path.read_bytes()[: 512 + 40] + b"\xff" * 200)
    with pytest.raises(InputError, match=r"rec.mseed"):
        read(path, **SI, **SCALES)
