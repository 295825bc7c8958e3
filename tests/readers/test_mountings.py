"""Mountings that gravity allows, against a body turned by hand."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from still import HEADING, LATITUDE

from gyronorth.attitude import mat_bn
from gyronorth.earth import EARTH_RATE, STANDARD_GRAVITY
from gyronorth.readers.axes import mat_bf
from gyronorth.readers.mountings import mountings


@pytest.mark.parametrize("axes", ["frd", "flu", "rfu", "bld", "drb", "urf"])
@pytest.mark.parametrize("attitude", [(0.0, 0.0), (0.3, -0.2), (-0.5, 0.4)])
def test_the_true_mounting_gives_the_true_heading_and_the_others_are_right_angles_off(axes, attitude):
    rate_n = EARTH_RATE * np.array([np.cos(LATITUDE), 0, -np.sin(LATITUDE)])
    mat = mat_bf(axes).T @ mat_bn(*attitude, HEADING)
    found = mountings(mat @ rate_n, mat @ [0, 0, -STANDARD_GRAVITY])
    by_axes = {each.axes: each for each in found}
    assert len(found) == 4
    assert_allclose(by_axes[axes].heading, HEADING, atol=1e-12)
    if attitude == (0.0, 0.0):
        others = sorted((each.heading - HEADING) / (np.pi / 2) % 4 for each in found)
        assert_allclose(np.round(others, 9) % 4, [0, 1, 2, 3], atol=1e-9)
    assert all(each.forward[1] in "xyz" for each in found)
    assert found[0].axes in ("frd", "flu", "rfu") or axes not in ("frd", "flu", "rfu")
