"""Every layout gives the truth: at the first try, or by following the line `Try:` of the one refusal."""

from __future__ import annotations

import json

import numpy as np
import pytest
from cases.field_layouts import FIELD
from cases.layouts import DPS, LAYOUTS
from cases.logger_layouts import LOGGERS
from cases.more_layouts import MORE
from cases.running import followed, info
from cases.vendor_layouts import VENDORS
from cases.worldwide_layouts import WORLDWIDE
from numpy.testing import assert_allclose

from gyronorth.earth import STANDARD_GRAVITY

ALL = [*LAYOUTS, *MORE, *FIELD, *LOGGERS, *VENDORS, *WORLDWIDE]


@pytest.mark.slow
@pytest.mark.parametrize("layout", ALL, ids=lambda layout: layout.name)
def test_a_layout_gives_the_truth(tmp_path, layout):
    (tmp_path / layout.name).write_bytes(layout.content)
    result = info([str(tmp_path / layout.name), *layout.options])
    if layout.asks:
        result = followed(result, dict(layout.fill))
    assert result.exit_code == 0, result.stderr
    found = json.loads(result.stdout)
    assert found["samples"] == layout.rows
    assert found["rate_hz"] == pytest.approx(layout.rate_hz, rel=1e-5)
    assert (found["gaps"], found["rows_dropped"]) == ([], 0)
    # The printed digits of each layout keep the mean of the rates within 0.01 deg/h, and gravity within 1e-3.
    assert_allclose(found["rate_mean_deg_h"], DPS.mean(axis=0) * 3600, atol=0.01)
    assert (found["force_mean_m_s2"] is None) == (not layout.accel)
    if layout.accel:
        assert_allclose(found["force_mean_m_s2"], [0, 0, -STANDARD_GRAVITY], atol=2e-3)
    assert layout.says in found["read_as"]


def test_the_names_differ():
    assert len({layout.name for layout in ALL}) == len(ALL) >= 100
    assert np.isfinite(DPS).all()
