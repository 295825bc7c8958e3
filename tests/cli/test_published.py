"""gyronorth published, and the settings that come along with train."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from typer.testing import CliRunner

from gyronorth.angles import angle_error
from gyronorth.cli import app
from gyronorth.errors import InputError
from gyronorth.published import LATITUDE, model_based, published
from gyronorth.readers import read


def test_the_reconstruction_is_written_whole(tmp_path):
    folder = tmp_path / "published"
    done = CliRunner().invoke(app, ["published", "-o", str(folder), "--rate", "1"])
    assert done.exit_code == 0, done.output
    assert "noise is simulated" in done.output
    paths = sorted(folder.iterdir())
    assert len(paths) == 60
    figures = published()
    for index in (0, 41, 59):
        recording = read(paths[index])
        assert recording.duration == pytest.approx(230.0)
        assert recording.latitude == pytest.approx(LATITUDE)
        assert recording.session == "published"
        assert recording.heading_true == pytest.approx(figures.heading_true[index])
        assert_allclose(recording.gyro_b.mean(axis=0), figures.mean_rate[index], atol=1e-9)
        assert abs(angle_error(model_based(recording.gyro_b), figures.heading_mean[index])) < 1e-6
    with pytest.raises(InputError, match="not empty"):
        CliRunner().invoke(app, ["published", "-o", str(folder)], catch_exceptions=False, standalone_mode=False)


@pytest.mark.slow
def test_a_seed_draws_other_noise(tmp_path):
    for name, seed in (("a", "0"), ("b", "0"), ("c", "1")):
        CliRunner().invoke(app, ["published", "-o", str(tmp_path / name), "--rate", "0.2", "--seed", seed])
    a, b, c = (read(tmp_path / name / "published_07.csv").gyro_b for name in "abc")
    assert np.array_equal(a, b)
    assert not np.array_equal(a, c)
