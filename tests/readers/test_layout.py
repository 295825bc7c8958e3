"""How a text file is laid out, and what is refused."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_array_equal
from still import SI, TITLES, csv_file, csv_rows, still

from gyronorth.errors import InputError
from gyronorth.readers import read, text
from gyronorth.readers.fields import split
from gyronorth.readers.layout import sniff


def test_commas_between_fields_and_in_numbers_are_refused(tmp_path):
    path = csv_file(tmp_path, [row.replace(".", ",") for row in csv_rows(30)])
    with pytest.raises(InputError, match=r"rec.csv has 7 titles but 14 fields in a row, and no points: commas stand"):
        read(path)


@pytest.mark.slow
@pytest.mark.parametrize("delimiter", [",", ";", "\t", "|", " "])
@pytest.mark.parametrize("encoding", ["utf-8", "utf-16", "utf-16-le", "latin-1"])
def test_delimiters_and_encodings_give_the_same_numbers(tmp_path, monkeypatch, delimiter, encoding):
    monkeypatch.setattr(text, "BLOCK_BYTES", 5001)  # blocks that end within a row, and within a character of UTF-16
    content = "\n".join(["# site: Hüfte", *SI, ",".join(TITLES)]) + "\n" + "".join(csv_rows(300))
    path = tmp_path / "rec.csv"
    head, rows = content[: content.index("\n0.0,") + 1], content[content.index("\n0.0,") + 1 :]
    path.write_bytes((head.replace(",", delimiter) + rows.replace(",", delimiter)).encode(encoding))
    recording = read(path)
    assert_array_equal(recording.gyro_b, still(300)[0])
    assert_array_equal(recording.accel_b, still(300)[1])


def test_rows_of_a_layout_are_counted_as_the_user_counts_lines(tmp_path):
    rows = csv_rows(60)
    rows[20] = "0.2,abc,0,0,0,0,-9.8\n"
    path = tmp_path / "rec.csv"
    path.write_text("LOGGER\n\n" + "\n".join([*SI, ",".join(TITLES)]) + "\n" + "".join(rows))
    with pytest.raises(InputError, match=r"^Row 27 of rec.csv: w_x is 'abc'"):
        read(path)


@pytest.mark.parametrize(
    "foot", ["END\n", "Total samples: 60\nEnd of file\n", "\n\n*** end ***\n", "Mean,0,0,0,0,0,0\n"]
)
def test_words_behind_the_last_row_are_no_rows_and_are_told(tmp_path, foot):
    path = csv_file(tmp_path, [*csv_rows(60), foot])
    layout = sniff(path)
    assert layout.footer == len([line for line in foot.split("\n") if line])
    assert "of footer" in layout.words()
    assert_array_equal(read(path).gyro_b, still(60)[0])


@pytest.mark.parametrize("last", ["0.6,1e-5,2e", "0.6,1e-5", "0.6,abc,0,0,0,0,0", "nan,0,0,0,0,0,0"])
def test_a_row_that_is_cut_off_is_no_footer(tmp_path, last):
    path = csv_file(tmp_path, [*csv_rows(60), last])
    assert sniff(path).footer == 0
    with pytest.raises(InputError, match="Row 65 of"):
        read(path)


def test_a_blank_line_costs_no_sample_where_there_is_a_clock_and_one_where_there_is_none(tmp_path):
    rows = csv_rows(60)
    path = csv_file(tmp_path, [*rows[:30], "\n", *rows[30:]])
    assert_array_equal(read(path).gyro_b, still(60)[0])
    bare = [row.split(",", 1)[1] for row in rows]
    path = csv_file(tmp_path, [*bare[:30], "\n", *bare[30:]], header=",".join(TITLES[1:]))
    with pytest.raises(InputError, match=r"Row 35 of rec.csv: it is empty"):
        read(path, rate_hz=100)


def test_rows_of_other_channels_are_no_rows(tmp_path):
    """Programs that log several rates leave the cells of the other channels empty."""
    rows = csv_rows(60)
    between = [f"{row.split(',')[0]}5,,,,,,,1013.2\n" for row in rows]
    path = csv_file(
        tmp_path,
        [line for row, other in zip(rows, between, strict=True) for line in (row.rstrip("\n") + ",\n", other)],
        header=",".join((*TITLES, "pressure")),
    )
    assert_array_equal(read(path).gyro_b, still(60)[0])


@given(st.lists(st.text(alphabet=st.characters(blacklist_characters='\r\n",;\t |', min_codepoint=33), min_size=1)))
@settings(deadline=None, max_examples=50)
def test_a_line_is_cut_at_its_delimiters(cells):
    assert split(",".join(cells), ",") == [cell.strip() for cell in cells]
