"""The rows that pyarrow reads are those of the own parser, bit for bit; what is not plain is left to the latter."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gyronorth.readers import text, text_arrow
from gyronorth.readers.text import Layout, parse_block
from gyronorth.readers.times import ClockColumns, TimeText

pytest.importorskip("pyarrow.csv")

#: Spellings on which parsers differ, beside numbers of any kind.
ODD = [
    *(
        "",
        " ",
        "nan",
        "NaN",
        "nan(3)",
        "-inf",
        "Infinity",
        "+1.5",
        "1.",
        ".5",
        ".",
        "1e",
        "1e5",
        "1E-400",
        "1e400",
        "1_0",
    ),
    *(
        "1_0",
        "0x10",
        "1d5",
        " 2 ",
        "\t3",
        "1 2",
        "#4",
        '"5"',
        '"6',
        "\r7",
        "7\r",
        "8\x00",
        "é",
        "\ufeff9",
        "1,5",
        "-",
        "--1",
    ),
    *("1e+05", "179769313486231580793e289", "4.9e-324", "2.5e-324", "0.1" + "0" * 400 + "1", "9007199254740993"),
]
FIELD = st.one_of(
    st.floats(width=64).map(repr),
    st.floats(allow_nan=False, allow_infinity=False).map("{:.25e}".format),
    st.decimals(allow_nan=False, allow_infinity=False, places=18).map(str),
    st.integers().map(str),
)
LAYOUTS = [
    Layout(titles=("a", "b", "c", "d"), use=(0, 1, 2, 3), delimiter=","),
    Layout(titles=("a", "b", "c", "d"), use=(1, 3, 2), delimiter=",", comments=(b"#",), blank=True),
    Layout(titles=("a", "b", "c"), use=(0, 1, 2), delimiter=",", trailing=True),
    Layout(titles=("a", "b", "c", "d"), use=(3, 1, 0), delimiter=None),
    Layout(titles=("a", "b", "c", "d"), use=(1, 2, 3), delimiter=None, texts=True),
    Layout(titles=("a", "b", "c", "d"), use=(1, 2, 3), delimiter=";", decimal=","),
    Layout(titles=("a", "b", "c", "d"), use=(2, 3), delimiter=";", clock=ClockColumns((0, 1), (1.0, 1e-9))),
]


def same(data: bytes, layout: Layout, monkeypatch: pytest.MonkeyPatch) -> bool:
    """Whether both ways give the same block; returns whether pyarrow took part."""
    taken = []

    def noted(*given):
        found = text_arrow.arrow_columns(*given)
        taken.append(found is not None)
        return found

    with monkeypatch.context() as patch, np.errstate(over="ignore", invalid="ignore"):
        patch.setattr(text, "is_worthwhile", lambda _: False)
        own = parse_block(data, 7, layout)
        patch.setattr(text, "is_worthwhile", lambda _: True)
        patch.setattr(text, "arrow_columns", noted)
        block = parse_block(data, 7, layout)
    assert block.values.tobytes() == own.values.tobytes() or np.array_equal(block.values, own.values, equal_nan=True)
    assert np.signbit(block.values).tobytes() == np.signbit(own.values).tobytes() or np.isnan(own.values).any()
    assert block.values.shape == own.values.shape
    assert np.array_equal(block.rows, own.rows)
    assert np.array_equal(block.bad.rows, own.bad.rows)
    assert block.bad.reasons == own.bad.reasons
    return any(taken)


def lines(rows: list[list[str]], layout: Layout) -> bytes:
    mark = layout.delimiter or " "
    end = mark if layout.trailing else ""
    written = [mark.join(row).replace(".", layout.decimal) + end for row in rows]
    return "".join(line + "\n" for line in written).encode("utf-8", "surrogatepass")


@given(layout=st.sampled_from(LAYOUTS), data=st.data())
@settings(max_examples=60, deadline=None)
def test_numbers_of_any_kind_are_equal_to_the_bit(layout, data):
    width = len(layout.titles)
    rows = data.draw(st.lists(st.lists(FIELD, min_size=width, max_size=width), min_size=1, max_size=6))
    with pytest.MonkeyPatch.context() as patch:
        assert same(lines(rows, layout), layout, patch)


@given(layout=st.sampled_from(LAYOUTS), data=st.data())
@settings(max_examples=40, deadline=None)
def test_odd_fields_lines_and_widths_end_alike(layout, data):
    field = st.one_of(st.sampled_from(ODD), st.just("1.25"), st.just("1.25"), st.just("-3"))
    width = len(layout.titles)
    row = st.one_of(st.lists(field, min_size=width, max_size=width), st.lists(field, max_size=width + 2))
    rows = data.draw(st.lists(row, min_size=1, max_size=5))
    with pytest.MonkeyPatch.context() as patch:
        same(lines(rows, layout), layout, patch)


def test_times_as_texts_are_equal(monkeypatch):
    layout = Layout(
        titles=("day", "a", "b", "time"), use=(1, 2), delimiter=",", texts=True,
        clock=ClockColumns((0, 3), text=TimeText("date and time", origin=738000)),
    )  # fmt: skip
    rows = [["2021-07-23", "1.5", "-2e-3", f"10:00:{i:02d}.{i:03d}"] for i in range(60)]
    assert same(lines(rows, layout), layout, monkeypatch)
    rows[7][3] = "noon"
    same(lines(rows, layout), layout, monkeypatch)


def test_a_whole_file_is_the_same_with_and_without_pyarrow(tmp_path, monkeypatch):
    import gyronorth as gn

    rng = np.random.default_rng(3)
    path = tmp_path / "x.csv"
    rows = np.column_stack([rng.normal(0, 1e-4, (4000, 3)), rng.normal([0.1, 0.2, -9.8], 1e-2, (4000, 3))])
    facts = "# rate_hz: 100\n# gyro_unit: rad/s\n# accel_unit: m/s2\n# axes: frd\n# latitude_deg: 40\n"
    path.write_text(
        facts + "w_x,w_y,w_z,f_x,f_y,f_z\n" + "".join(",".join(map(repr, row)) + "\n" for row in rows.tolist())
    )
    monkeypatch.setattr(text, "BLOCK_BYTES", 50_000)
    monkeypatch.setattr(text, "is_worthwhile", lambda _: True)
    fast = gn.read(path)
    monkeypatch.setattr(text, "is_worthwhile", lambda _: False)
    own = gn.read(path)
    assert fast.gyro_b.tobytes() == own.gyro_b.tobytes()
    assert np.array_equal(np.asarray(fast.accel_b), np.asarray(own.accel_b))
    assert np.array_equal(own.gyro_b, rows[:, :3])
