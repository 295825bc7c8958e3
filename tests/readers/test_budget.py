"""One budget for what files decode to: claims, rows that come, endless and greedy decoders."""

import json
import sqlite3

import numpy as np
import pytest

from gyronorth import readers
from gyronorth.errors import InputError
from gyronorth.readers.budget import DECODED_FLOOR, DECODED_RATIO, check_claim, counted, largest_decoded
from gyronorth.readers.source import RATES, Facts, Source, blocks_of

ROWS = 1 << 20


def source_of(blocks):
    values = np.zeros((ROWS, 3))
    return Source("test", "a.test", RATES, lambda: blocks_of((values for _ in range(blocks)), 1), Facts())


def test_rows_beyond_the_budget_of_the_file_end_it():
    size, each = 1000, ROWS * 3 * 8
    fitting = largest_decoded(size) // each
    assert sum(1 for _ in counted(source_of(fitting), size).blocks()) == fitting
    with pytest.raises(InputError, match=r"a\.test has 1000 bytes, and it decodes to more than"):
        list(counted(source_of(fitting + 1), size).blocks())


def test_the_budget_grows_with_the_file():
    assert largest_decoded(0) == DECODED_FLOOR
    assert largest_decoded(1 << 30) == DECODED_FLOOR + (DECODED_RATIO << 30)
    check_claim("a", "x", largest_decoded(77), 77)
    with pytest.raises(InputError, match="x claims 64 MiB"):
        check_claim("a", "x", largest_decoded(77) + 1, 77)


@pytest.mark.slow
def test_a_parquet_file_of_one_repeated_row_is_not_expanded(tmp_path):
    arrow, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    count = 5_000_000
    columns = {"t": arrow.array(np.zeros(count)), **{name: arrow.array(np.zeros(count)) for name in RATES}}
    path = tmp_path / "wide.parquet"
    parquet.write_table(arrow.table(columns), path, compression="zstd", row_group_size=1 << 21)
    assert path.stat().st_size < 100_000
    with pytest.raises(InputError):
        readers.read(path, rate_hz=100, axes="frd", gyro_unit="rad/s")


def test_a_database_with_a_view_for_a_table_is_not_run(tmp_path):
    path = tmp_path / "endless.db3"
    with sqlite3.connect(path) as database:
        database.execute("CREATE TABLE topics (id INTEGER, name TEXT, type TEXT)")
        database.execute(
            "CREATE VIEW messages AS WITH RECURSIVE c(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM c) "
            "SELECT i AS id, 1 AS topic_id, i AS timestamp, x'00' AS data FROM c"
        )
    database.close()
    with pytest.raises(InputError, match="messages is a view"):
        readers.read(path)


@pytest.mark.slow
def test_an_npz_array_beyond_the_budget_is_not_inflated(tmp_path):
    path = tmp_path / "zeros.npz"
    np.savez_compressed(
        path, schema="gyronorth.recording/1", rate_hz=100.0, gyro_b=np.zeros((DECODED_FLOOR // 24 + ROWS, 3))
    )
    with pytest.raises(InputError, match="gyro_b claims 88 MiB"):
        readers.read(path)


def test_what_a_foreign_reader_refuses_is_told_as_before(tmp_path):
    path = tmp_path / "cut.parquet"
    path.write_bytes(b"PAR1" + json.dumps({}).encode())
    with pytest.raises(InputError, match="is cut off"):
        readers.read(path)
