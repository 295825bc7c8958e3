"""Streams of text in layouts of others: the same rows as of a file that holds them."""

from __future__ import annotations

import numpy as np
import pytest
from cases.layouts import LAYOUTS
from cases.more_layouts import MORE
from numpy.testing import assert_allclose

from gyronorth.errors import InputError
from gyronorth.live.reader import StreamReader
from gyronorth.readers import ReadOptions, read

ALL = {layout.name: layout for layout in (*LAYOUTS, *MORE)}
TITLED = "Time (ms);Gyro X (deg/s);Gyro Y (deg/s);Gyro Z (deg/s);Acc X (g);Acc Y (g);Acc Z (g)"
ROWS = 60


def lines(form: str, *, scale: float = 1.0, first: int = 0) -> list[str]:
    rng = np.random.default_rng(2)
    rates, forces = rng.normal(0, 1e-3, (ROWS, 3)), rng.normal([0, 0, -1], 1e-3, (ROWS, 3))
    return [form.format((first + 10 * i) * scale, *rates[i], *forces[i]) for i in range(ROWS)]


def streamed(data: bytes, cuts: list[int], **options) -> StreamReader:
    reader = StreamReader("stream", ReadOptions(**options))
    batches = []
    for start, end in zip([0, *cuts], [*cuts, len(data)], strict=True):
        batches += reader.push(data[start:end])
    batches += reader.end()
    reader.values = np.concatenate([batch.rows.values for batch in batches])
    reader.form = batches[-1].form
    return reader


def as_file(tmp_path, data: bytes, **options):
    path = tmp_path / "rec.csv"
    path.write_bytes(data)
    return read(path, **options)


SEMICOLONS = "{:.0f};{:.9f};{:.9f};{:.9f};{:.6f};{:.6f};{:.6f}"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("head", "form", "comma"),
    [
        (TITLED, SEMICOLONS, False),
        (TITLED, SEMICOLONS, True),
        (TITLED.replace(";", "\t"), SEMICOLONS.replace(";", "\t"), False),
        (TITLED.replace(";", ","), SEMICOLONS.replace(";", ","), False),
        (f"LOGGER 3\n\n{TITLED.replace(' ', '').replace(';', ' ')}", SEMICOLONS.replace(";", " "), False),
    ],
)
@pytest.mark.parametrize("cut", [[], [1, 40, 700, 701, 2500], list(range(0, 3000, 7))])
def test_a_header_with_units_is_read_as_that_of_a_file(tmp_path, head, form, comma, cut):
    text = "\n".join([head, *lines(form), ""])
    data = text.replace(".", ",").encode() if comma else text.encode()
    reader = streamed(data, cut, axes="frd", latitude=0.5)
    recording = as_file(tmp_path, data, axes="frd", latitude=0.5)
    assert reader.form.columns == ("t", "w_x", "w_y", "w_z", "f_x", "f_y", "f_z")
    assert_allclose(reader.values[:, 0], np.arange(ROWS) * 0.01, atol=1e-12)
    assert_allclose(reader.values[:, 1:4], recording.gyro_b, rtol=1e-12)
    assert_allclose(reader.values[:, 4:], recording.accel_b, rtol=1e-12)
    assert reader.tally.garbage == 0


def test_a_header_in_latin_1_is_a_header(tmp_path):
    head = "Time (ms),Gyr X (°/s),Gyr Y (°/s),Gyr Z (°/s),Acc X (g),Acc Y (g),Acc Z (g)"
    data = "\n".join([head, *lines(SEMICOLONS.replace(";", ",")), ""]).encode("latin-1")
    assert streamed(data, [40], axes="frd").values[-1, 0] == pytest.approx(0.59)


def test_bad_lines_and_a_second_header_are_left_out():
    rows = lines(SEMICOLONS)
    text = "\n".join([TITLED, *rows[:45], "1;2;3", TITLED, "garbage", *rows[45:], ""])
    reader = streamed(text.encode(), [1000, 4000], axes="frd")
    assert len(reader.values) == ROWS
    assert (reader.tally.lines, reader.tally.garbage) == (ROWS + 2, 2)


def test_a_clock_of_the_day_goes_on_past_midnight():
    rows = lines("{:.0f},{:.9f},{:.9f},{:.9f},{:.6f},{:.6f},{:.6f}")
    rows = [row.split(",", 1)[1] for row in rows]
    stamps = [f"{'23:59:59' if i < 30 else '00:00:00'}.{(70 + i) % 100:02d}0" for i in range(ROWS)]
    head = "Time,Gyro X (rad/s),Gyro Y (rad/s),Gyro Z (rad/s),Acc X (g),Acc Y (g),Acc Z (g)"
    text = "\n".join([head, *(f"{stamp},{row}" for stamp, row in zip(stamps, rows, strict=True)), ""])
    reader = streamed(text.encode(), [], axes="frd")
    assert_allclose(np.diff(reader.values[:, 0]), 0.01, atol=1e-9)


def test_what_is_open_is_asked_with_its_answer():
    head = "time;gx;gy;gz;ax;ay;az"
    text = "\n".join([head, *lines(SEMICOLONS), ""]).encode()
    with pytest.raises(InputError, match=r"does not say in which unit[\s\S]*\nTry: .*--gyro-unit"):
        streamed(text, [], axes="frd")
    reader = streamed(text, [], axes="frd", gyro_unit="deg/s", accel_unit="g", time_unit="ms")
    assert reader.values[-1, 0] == pytest.approx(0.59)


def test_without_a_header_declared_columns_are_read():
    rows = [f"a;{row}" for row in lines(SEMICOLONS)]
    columns = {"t": 1, "w_x": 2, "w_y": 3, "w_z": 4, "f_x": 5, "f_y": 6, "f_z": 7}
    units = {"gyro_unit": "deg/s", "accel_unit": "g", "time_unit": "ms"}
    reader = streamed("\n".join([*rows, ""]).encode(), [], columns=columns, **units)
    assert len(reader.values) == ROWS
    with pytest.raises(InputError, match=r"has no header.*\nTry: .*--columns t=1"):
        streamed("\n".join([*rows, ""]).encode(), [], **units)


def test_a_short_stream_is_told_at_its_end():
    text = "\n".join([TITLED, *lines(SEMICOLONS)[:5]])
    assert len(streamed(text.encode(), [100], axes="frd").values) == 5


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name, layout in ALL.items() if name.endswith((".csv", ".txt"))][::9])
def test_layouts_of_files_are_read_from_a_stream(tmp_path, name):
    layout = ALL[name]
    if layout.options != ("--axes", "frd") or layout.asks or layout.rate_hz != 100 or b"\x00" in layout.content:
        pytest.skip("asks, or is no stream of lines")
    recording = as_file(tmp_path, layout.content, axes="frd")
    reader = streamed(layout.content, [5000], axes="frd")
    if reader.form.decoded is not None:
        assert_allclose(reader.values[:, reader.form.columns.index("w_x")], recording.gyro_b[:, 0], rtol=1e-9)


@pytest.mark.parametrize("head", ["t,w_x,w_y,w_z,f_x,f_y,f_z\n", ""])
def test_counts_are_scaled_as_those_of_a_file(tmp_path, head):
    rng = np.random.default_rng(5)
    forces = rng.integers([-90, -90, -65600], [90, 90, -65400], (ROWS, 3))
    counts = np.column_stack([rng.integers(-900, 900, (ROWS, 3)), forces])
    rows = "".join(f"{i / 100:.2f},{','.join(map(str, row))}\n" for i, row in enumerate(counts.tolist()))
    options = {"gyro_unit": "deg/s", "gyro_scale": 2.0**-20, "accel_unit": "g", "accel_scale": 2.0**-16}
    reader = streamed((head + rows).encode(), [5, 400], **options)
    si = np.radians(2.0**-20) * np.ones(3), 9.80665 * 2.0**-16 * np.ones(3)
    assert_allclose(reader.values[:, 1:], counts * np.concatenate(si), rtol=1e-14)
    if head:
        recording = as_file(tmp_path, (head + rows).encode(), latitude=0.5, **options)
        assert_allclose(reader.values[:, 1:4], recording.gyro_b, rtol=1e-12)
