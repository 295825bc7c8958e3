"""A group for each sensor with a clock of its own, folders of KITTI, tables of Arrow and ORC, and phones' columns."""

from __future__ import annotations

from datetime import timedelta
from pathlib import Path

import numpy as np
import pytest
from cases.layouts import ACCEL, DPS, FLU, GYRO, ROWS, START, TIME, G
from cases.running import RUN, followed, info
from numpy.testing import assert_allclose

from gyronorth.cli import app
from gyronorth.errors import InputError
from gyronorth.readers import read, recordings_in


def hdf5(path: Path, *, by_axis: bool) -> Path:
    """The accelerometer at half the rate and a little later, a matrix or three datasets a sensor."""
    h5py = pytest.importorskip("h5py")
    with h5py.File(path / "imu.h5", "w") as file:
        for name, values, times, unit in (
            ("gyroscope", DPS, TIME, "deg/s"), ("accelerometer", ACCEL[::2], TIME[::2] + 0.003, "m/s^2"),
        ):  # fmt: skip
            group = file.create_group(f"sensors/{name}")
            group.create_dataset("timestamps", data=1.7e9 + times)
            parts = dict(zip("xyz", values.T, strict=True)) if by_axis else {"data": values}
            for title, part in parts.items():
                group.create_dataset(title, data=part).attrs["units"] = unit
    return path / "imu.h5"


@pytest.mark.parametrize("by_axis", [True, False])
def test_groups_with_clocks_of_their_own_are_joined_on_time(tmp_path, by_axis):
    recording = read(hdf5(tmp_path, by_axis=by_axis), axes="frd")
    assert_allclose(recording.gyro_b, GYRO, rtol=1e-6)
    assert recording.accel_b is not None
    assert_allclose(recording.accel_b.mean(axis=0), ACCEL[::2].mean(axis=0), atol=1e-3)
    assert "joined on time" in recording.read_as


@pytest.mark.slow
def test_structs_with_clocks_of_their_own_are_joined_on_time(tmp_path):
    savemat = pytest.importorskip("scipy.io").savemat
    groups = {"gyr": {"data": DPS, "time": TIME}, "acc": {"data": G[::2], "time": TIME[::2]}}
    savemat(tmp_path / "imu.mat", {"log": groups})
    result = followed(info([str(tmp_path / "imu.mat"), "--axes", "frd"]), {}, "--json")
    assert result.exit_code == 0
    assert "joined on time" in result.stdout


def test_a_struct_for_each_sample_is_refused_with_its_cure(tmp_path):
    savemat = pytest.importorskip("scipy.io").savemat
    each = np.zeros(30, dtype=[("t", "O"), ("gyro", "O")])
    for i in range(30):
        each[i] = TIME[i], GYRO[i]
    savemat(tmp_path / "imu.mat", {"imu": each})
    with pytest.raises(InputError, match=r"writetable\(struct2table\(imu\), 'imu.csv'\)"):
        read(tmp_path / "imu.mat")


FORMAT = (
    "lat:   latitude (deg)\nwx:    angular rate around x (rad/s)\nwy:    y\nwz:    z\nax:    acceleration\nay:\naz:\n"
)


def oxts(path: Path, rows: int = ROWS) -> Path:
    folder = path / "2011_09_26_drive_0001_sync" / "oxts"
    (folder / "data").mkdir(parents=True)
    for i in range(rows):
        row = " ".join(f"{x:.14f}" for x in (48.0, *(GYRO[i] * FLU), *(ACCEL[i] * FLU)))
        (folder / "data" / f"{i:010d}.txt").write_text(row + "\n")
    times = [START + timedelta(seconds=float(t)) for t in TIME]
    (folder / "timestamps.txt").write_text("".join(f"{t:%Y-%m-%d %H:%M:%S.%f}000\n" for t in times))
    (folder / "dataformat.txt").write_text(FORMAT)
    return folder


@pytest.mark.slow
def test_a_folder_of_kitti_is_a_recording_in_the_units_and_axes_of_the_dataset(tmp_path):
    folder = oxts(tmp_path)
    recording = read(folder)
    assert_allclose(recording.gyro_b, GYRO, atol=1e-13)
    assert_allclose(recording.accel_b, ACCEL, atol=1e-12)
    assert (recording.axes, recording.axes_origin, recording.notes) == ("flu", "stated", ())
    assert recordings_in(tmp_path) == [folder]
    result = RUN.invoke(app, ["info", str(folder.parent)])
    assert "oxts" in result.stdout


def test_a_folder_of_kitti_with_missing_samples_is_refused(tmp_path):
    with pytest.raises(InputError, match="30 files of samples and 800 stamps"):
        read(oxts(tmp_path, 30))


def test_names_that_dataformat_lacks_are_said(tmp_path):
    folder = oxts(tmp_path, 3)
    (folder / "dataformat.txt").write_text("lat: latitude\nwx: rate\n")
    with pytest.raises(InputError, match="does not name wy, wz, ax, ay, az; it names lat, wx"):
        read(folder)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["imu.arrow", "imu.arrows", "imu.feather", "imu.orc", "imu.parquet"])
def test_tables_of_arrow_have_a_clock_by_its_type(tmp_path, name):
    """Whatever the column is called; one that is read alone by its title of no meaning too."""
    arrow, feather = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.feather")
    stamps = np.datetime64("2024-03-01T11:58:00", "us") + np.rint(1e6 * TIME).astype("timedelta64[us]")
    six = zip((f"{s}_{a}_{u}" for s, u in (("gyro", "dps"), ("acc", "g")) for a in "xyz"), (*DPS.T, *G.T), strict=True)
    table = arrow.table({"a": stamps, **dict(six)})
    path = tmp_path / name
    if name.endswith(".orc"):
        pytest.importorskip("pyarrow.orc").write_table(table, str(path))
    elif name.endswith(".parquet"):
        pytest.importorskip("pyarrow.parquet").write_table(table, path)
    elif name.endswith(".feather"):
        feather.write_feather(table, str(path))
    else:
        with arrow.OSFile(str(path), "wb") as sink, arrow.ipc.new_stream(sink, table.schema) as stream:
            stream.write_table(table)
    recording = read(path, axes="frd")
    assert_allclose(recording.gyro_b, GYRO, rtol=1e-9)
    assert recording.rate_hz == pytest.approx(100.0)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["bare.parquet", "bare.feather"])
def test_tables_whose_titles_say_nothing_are_told_by_their_numbers(tmp_path, name):
    arrow, feather = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.feather")
    columns = {f"c{i}": column for i, column in enumerate((TIME, *DPS.T, *G.T))}
    write = pytest.importorskip("pyarrow.parquet").write_table if "parquet" in name else feather.write_feather
    write(arrow.table(columns), str(tmp_path / name))
    result = followed(info([str(tmp_path / name), "--axes", "frd"]), {}, "--json")
    assert result.exit_code == 0, result.stderr
    assert '"force_mean_m_s2": null' not in result.stdout


def test_gaps_that_come_evenly_may_be_none(tmp_path):
    """Stamps of 95 Hz on ticks of 10 ms look like 100 Hz with a loss every 20th sample; random losses do not."""
    head = "# gyro_unit: rad/s\n# accel_unit: m/s2\n# axes: frd\nt,w_x,w_y,w_z,f_x,f_y,f_z\n"

    def notes(kept: np.ndarray) -> set[str]:
        values = np.column_stack([np.arange(len(kept))[kept] / 100, *GYRO[:1].repeat(kept.sum(), axis=0).T,
                                  *ACCEL[:1].repeat(kept.sum(), axis=0).T])  # fmt: skip
        rows = "".join(",".join(f"{x:.9g}" for x in row) + "\n" for row in values)
        (tmp_path / "rec.csv").write_text(head + rows)
        return {note.code for note in read(tmp_path / "rec.csv").notes}

    assert "rate_conflict" in notes(np.arange(2000) % 20 != 10)
    lost = np.random.default_rng(3).choice(np.arange(1, 1999), 100, replace=False)
    assert "rate_conflict" not in notes(~np.isin(np.arange(2000), lost))
