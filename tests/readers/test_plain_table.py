"""Tables of numbers beyond doubt: what is taken for one needs no rewriting, and what needs it is not."""

from __future__ import annotations

import pytest

from gyronorth.readers.plain_table import is_plain_table
from gyronorth.readers.records import rewriter_of

ROWS = b"".join(b"%d,0.1,-2e-5,3,0.5,0,-9.8\n" % i for i in range(60))
PLAIN = {
    "comments and titles": b"# rate_hz: 600\n# axes: frd\nt,w_x,w_y,w_z,f_x,f_y,f_z\n" + ROWS,
    "titles alone": b"t,gx (deg/s),gy (deg/s),gz (deg/s),ax,ay,az\r\n" + ROWS,
    "no titles": ROWS,
    "cut off in a row": b"t,w_x,w_y,w_z,f_x,f_y,f_z\n" + ROWS + b"60,0.1,-2e",
}
OTHERS = {
    "objects": b'{"t": 0.1, "w_x": 1}\n' * 60,
    "a column of words": b"t,w_x,name\n" + b"0.1,2,gyro\n" * 60,
    "nan": b"t,w_x,w_y,w_z\n" + b"0.1,nan,2,3\n" * 60,
    "semicolons": b"t;w_x;w_y;w_z\n" + b"0,1;2;3;4\n" * 60,
    "Fortran": b"t,w_x,w_y,w_z\n" + b"0.1,1D-5,2,3\n" * 60,
    "parts of a phone": b"t,x,y,z,gravityX,gravityY,gravityZ,userAccelerationX\n" + ROWS,
    "parts of a phone in a comment": b"#t,x,y,z,gravityX,gravityY,gravityZ,userAccelerationX\n" + ROWS,
    "GnssLogger": b"# UncalGyro,utcTimeMillis,elapsedRealtimeNanos,x,y,z\n" + ROWS,
    "comments below": b"t,w_x,w_y,w_z\n" + ROWS + b"# end\n",
    "titles alone, without rows": b"t,w_x,w_y,w_z\n",
    "comments alone": b"# rate_hz: 600",
    "a coloured comment": b"#\x1b[32m t,w_x,w_y,w_z\x1b[0m\nt,w_x,w_y,w_z\n" + ROWS,
    "coloured": b"\x1b[32mt,w_x,w_y,w_z\x1b[0m\n" + ROWS,
}


@pytest.mark.parametrize("name", PLAIN)
def test_a_table_of_numbers_is_one_and_is_written_anew_by_nothing(name):
    assert is_plain_table(PLAIN[name])
    assert rewriter_of(PLAIN[name]) is None


@pytest.mark.parametrize("name", OTHERS)
def test_what_is_not_beyond_doubt_is_looked_at_closely(name):
    assert not is_plain_table(OTHERS[name])
