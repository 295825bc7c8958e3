"""Units, axes, mounting and latitude: declared, stated, contradicted, implausible."""

from __future__ import annotations

from math import cos, degrees, pi, radians, sin

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from still import HEADING, LATITUDE, TITLES, csv_file, rows_of, still

from gyronorth import heading
from gyronorth.angles import DEG_PER_HOUR
from gyronorth.earth import EARTH_RATE, STANDARD_GRAVITY
from gyronorth.errors import InputError
from gyronorth.readers import ReadOptions, read
from gyronorth.readers.axes import convention, mat_bf

RATE_HZ = 50.0


def unit_file(folder, *, gyro=1.0, accel=1.0, rows=1000, comments=(), mat=None, time=True):
    """A body at rest with its samples divided by a unit, or turned by `mat` (body to file axes)."""
    rates, forces = still(rows)
    if mat is not None:
        rates, forces = rates @ np.transpose(mat), forces @ np.transpose(mat)
    columns = [np.arange(rows) / RATE_HZ, rates / gyro, forces / accel]
    return csv_file(folder, rows_of(columns if time else columns[1:]), comments=comments, header=",".join(TITLES))


@pytest.mark.parametrize(("name", "size"), [("rad/s", 1.0), ("deg/s", pi / 180), ("deg/h", pi / 180 / 3600)])
@pytest.mark.parametrize("how", ["declared", "stated"])
def test_gyro_units(tmp_path, name, size, how):
    comments = ["# accel_unit: m/s2"] + ([f"# gyro_unit: {name}"] if how == "stated" else [])
    path = unit_file(tmp_path, gyro=size, comments=comments)
    recording = read(path, gyro_unit=name if how == "declared" else None)
    assert_allclose(recording.gyro_b, still(1000)[0], rtol=1e-13)


@pytest.mark.parametrize(("name", "size"), [("m/s2", 1.0), ("g", 9.80665)])
def test_accelerometer_units(tmp_path, name, size):
    recording = read(unit_file(tmp_path, accel=size), gyro_unit="rad/s", accel_unit=name)
    assert_allclose(recording.accel_b, still(1000)[1], rtol=1e-13)


@pytest.mark.parametrize("unit", ["rad/s", "deg/s", "deg/h"])
def test_increments_are_divided_by_the_interval(tmp_path, unit):
    size = {"rad/s": 1.0, "deg/s": pi / 180, "deg/h": DEG_PER_HOUR}[unit]
    path = unit_file(tmp_path, gyro=size * RATE_HZ, accel=RATE_HZ)
    recording = read(path, gyro_unit=unit, accel_unit="m/s2", increments=True)
    assert_allclose(recording.gyro_b, still(1000)[0], rtol=1e-9)
    assert_allclose(recording.accel_b, still(1000)[1], rtol=1e-9)


def test_units_that_nobody_states_are_asked_for(tmp_path):
    path = unit_file(tmp_path)
    with pytest.raises(InputError, match=r"in which unit w_x, w_y, w_z are: Earth rate, .* fits --gyro-unit rad/s, 15"):
        read(path, accel_unit="m/s2")
    with pytest.raises(InputError, match=r"in which unit f_x, f_y, f_z are: gravity fits m/s2, 9.807 m/s2"):
        read(path, gyro_unit="rad/s")


@pytest.mark.parametrize(
    ("option", "value", "message"),
    [
        ("gyro_unit", "deg/s", "states gyro_unit rad/s; deg/s is declared"),
        ("accel_unit", "g", "states accel_unit m/s2; g is declared"),
        ("axes", "flu", "states axes frd; flu is declared"),
        ("latitude", radians(32.3), r"states latitude 32.1100 deg; 32.3000 deg is given.*may differ by 0.1 deg"),
    ],
)
def test_declarations_that_contradict_the_file(tmp_path, option, value, message):
    comments = ["# gyro_unit: rad/s", "# accel_unit: m/s2", "# axes: frd", "# latitude_deg: 32.11"]
    with pytest.raises(InputError, match=message):
        read(unit_file(tmp_path, comments=comments), **{option: value})


def test_of_latitudes_that_agree_the_given_one_counts(tmp_path):
    comments = ["# gyro_unit: rad/s", "# accel_unit: m/s2", "# axes: frd", "# latitude_deg: 32.11"]
    options = {"gyro_unit": "rad/s", "accel_unit": "m/s2", "axes": "+x+y+z", "latitude": radians(32.2)}
    assert read(unit_file(tmp_path, comments=comments), **options).latitude == radians(32.2)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"gyro_unit": "deg"}, r"gyro_unit is 'deg'; one of rad/s, deg/s, deg/h, mdeg/s"),
        ({"accel_unit": "kg"}, r"accel_unit is 'kg'; one of m/s2, g, mg"),
        ({"rate_hz": 0}, "declared rate is 0 Hz"),
        ({"rate_hz": float("nan")}, "declared rate is nan Hz"),
        ({"latitude": 32.11}, "latitude is 32.11 rad, 1839.77 deg"),
        ({"boresight": (0, 0, float("inf"))}, "boresight is"),
        ({"window": (5, 5)}, "window is 5:5 s"),
        ({"window": (0, float("nan"))}, "window is 0:nan s"),
        ({"axes": "xyz"}, "axes is 'xyz'; three letters"),
        ({"axes": "fru"}, "axes is 'fru', which is left-handed"),
        ({"axes": "ffd"}, "axes is 'ffd'; each of the three directions must occur once"),
        ({"axes": "+x+x-z"}, "each of the three directions"),
        ({"axes": "+x+y-z"}, "left-handed"),
        ({"format": "xls"}, "format is 'xls'; one of csv"),
        ({"variable": "data"}, "variable 'data' is declared, but rec.csv is no file of several tables or arrays"),
        ({"topic": "/imu"}, "topic '/imu' is declared, but rec.csv is neither a bag nor an MCAP file"),
    ],
)
def test_declarations_that_make_no_sense(tmp_path, options, message):
    with pytest.raises(InputError, match=message):
        read(unit_file(tmp_path), **options)


def test_unknown_declarations_are_the_callers_fault(tmp_path):
    with pytest.raises(TypeError, match="no declaration gyro_units; there are rate_hz, axes"):
        read(unit_file(tmp_path), gyro_units="rad/s")
    with pytest.raises(TypeError, match="not both"):
        read(unit_file(tmp_path), ReadOptions(), gyro_unit="rad/s")


# Where x, y and z of the file point, in (forward, right, down): the rows by hand.
BY_HAND = {
    "frd": ((1, 0, 0), (0, 1, 0), (0, 0, 1)),
    "flu": ((1, 0, 0), (0, -1, 0), (0, 0, -1)),
    "rfu": ((0, 1, 0), (1, 0, 0), (0, 0, -1)),
    "+y+x-z": ((0, 1, 0), (1, 0, 0), (0, 0, -1)),
    "bld": ((-1, 0, 0), (0, -1, 0), (0, 0, 1)),
    "drb": ((0, 0, 1), (0, 1, 0), (-1, 0, 0)),
    "-z+y+x": ((0, 0, 1), (0, 1, 0), (-1, 0, 0)),
}


@pytest.mark.parametrize("axes", BY_HAND)
def test_axes_bring_every_mounting_to_the_same_body(tmp_path, axes):
    path = unit_file(tmp_path, mat=BY_HAND[axes])
    recording = read(path, axes=axes, gyro_unit="rad/s", accel_unit="m/s2")
    assert_array_equal(recording.gyro_b, still(1000)[0])
    assert_array_equal(recording.accel_b, still(1000)[1])
    assert recording.notes == ()
    assert_array_equal(mat_bf(axes).T, BY_HAND[axes])


def test_convention_names_every_right_handed_mounting():
    letters = [a + b + c for a in "fbrldu" for b in "fbrldu" for c in "fbrldu"]
    found = []
    for axes in letters:
        try:
            mat = mat_bf(axes)
        except InputError:
            continue
        assert convention(mat) == axes
        found.append(axes)
    assert len(found) == 24  # the rotations of a cube


def test_upside_down_or_undeclared_axes_are_suspect(tmp_path):
    path = unit_file(tmp_path, mat=BY_HAND["flu"])
    units = {"gyro_unit": "rad/s", "accel_unit": "m/s2"}
    declared, undeclared = read(path, axes="frd", **units).notes, read(path, **units).notes
    for (note,), blocking in ((declared, False), (undeclared, True)):
        assert (note.code, note.blocking) == ("axes_suspect", blocking)
        assert "+9.81) m/s^2 in file axes: its z axis points up, which does not fit axes frd" in note.message
        assert "flu (forward-left-up) or rfu (right-forward-up)" in note.message
        assert note.value == pytest.approx(-1, abs=1e-3)
    assert "Declare them: --axes" in undeclared[0].message
    assert read(path, axes="flu", **units).notes == ()
    # The other way round: frd taken for flu.
    (note,) = read(unit_file(tmp_path), axes="flu", **units).notes
    assert (
        "its z axis points down, which does not fit axes flu. Most likely the file has other axes: frd" in note.message
    )


@pytest.mark.slow
def test_a_valid_heading_needs_axes_that_are_not_suspect(tmp_path):
    path = unit_file(tmp_path, mat=BY_HAND["rfu"], rows=5000)
    units = {"gyro_unit": "rad/s", "accel_unit": "m/s2", "latitude": LATITUDE}
    with pytest.raises(InputError, match=r"Declare them: --axes with one of these"):
        heading(read(path, **units))
    estimate = heading(read(path, axes="rfu", **units))
    assert degrees(estimate.heading or 0) == pytest.approx(degrees(HEADING), abs=1)
    # What is refused anyway stays refused, with its reasons and the warning.
    poor = read(path, **units).without_bias([1e-3, 0, 0])
    assert not heading(poor).valid
    assert "axes_suspect" in [finding.code for finding in heading(poor).warnings]
    # Declared all the same: a warning.
    assert [finding.code for finding in heading(read(path, axes="frd", **units)).warnings].count("axes_suspect") == 1


def test_a_sensor_on_its_side_is_told_which_axes_fit(tmp_path):
    # x down, y right, z back: gravity along x.
    (note,) = read(unit_file(tmp_path, mat=BY_HAND["drb"]), gyro_unit="rad/s", accel_unit="m/s2").notes
    assert "its x axis points down" in note.message
    assert "-z+y+x (drb)" in note.message
    for text in note.message.split("other axes: ")[1].split(". ")[0].split(" or "):
        axes, letters = text.rstrip(")").split(" (")
        assert convention(mat_bf(axes)) == letters
        assert letters[0] == "d"


@pytest.mark.parametrize("tilt_deg", [0, 35, 55])
def test_a_tilt_is_not_suspect(tmp_path, tilt_deg):
    c, s = cos(radians(tilt_deg)), sin(radians(tilt_deg))
    path = unit_file(tmp_path, mat=((1, 0, 0), (0, c, s), (0, -s, c)))
    assert read(path, gyro_unit="rad/s", accel_unit="m/s2", axes="frd").notes == ()


@pytest.mark.parametrize("yaw_deg", [0, 10, -90])
def test_boresight_turns_the_sensors_heading_into_the_vehicles(tmp_path, yaw_deg):
    # The sensor points to 40 deg; turned clockwise by yaw in the vehicle, the vehicle points to 40 - yaw.
    recording = read(unit_file(tmp_path), gyro_unit="rad/s", accel_unit="m/s2", boresight=(0.0, 0.0, radians(yaw_deg)))
    found = heading(recording, latitude=LATITUDE, method="mean").heading
    assert found is not None
    assert degrees(found) == pytest.approx((degrees(HEADING) - yaw_deg) % 360, abs=0.5)


def test_boresight_takes_roll_and_pitch_out(tmp_path):
    # A sensor rolled right side down by 20 deg and pitched nose up by 10 deg in a level vehicle.
    roll, pitch = radians(20), radians(10)
    mat_pitch = np.array([[cos(pitch), 0, -sin(pitch)], [0, 1, 0], [sin(pitch), 0, cos(pitch)]])
    mat_roll = np.array([[1, 0, 0], [0, cos(roll), sin(roll)], [0, -sin(roll), cos(roll)]])
    path = unit_file(tmp_path, mat=mat_roll @ mat_pitch)
    recording = read(path, gyro_unit="rad/s", accel_unit="m/s2", boresight=(roll, pitch, 0.0))
    assert_allclose(recording.accel_b, still(1000)[1], atol=1e-12)
    assert_allclose(recording.gyro_b, still(1000)[0], atol=1e-18)


GYRO_UNITS = {"rad/s": 1.0, "deg/s": pi / 180, "deg/h": DEG_PER_HOUR}


@pytest.mark.slow
@pytest.mark.parametrize("latitude", [None, LATITUDE])
@pytest.mark.parametrize("true", GYRO_UNITS)
@pytest.mark.parametrize("declared", GYRO_UNITS)
def test_a_wrong_gyro_unit_is_found_out_and_the_right_one_named(tmp_path, true, declared, latitude):
    path = unit_file(tmp_path, gyro=GYRO_UNITS[true], rows=5000)
    options = {"gyro_unit": declared, "accel_unit": "m/s2", "latitude": latitude}
    if true == declared:
        read(path, **options)
        return
    with pytest.raises(InputError, match=rf"{declared} is right.*15.04 deg/h.*--gyro-unit {true} fits"):
        read(path, **options)


def test_increments_declared_or_not_are_found_out(tmp_path):
    units = {"gyro_unit": "rad/s", "accel_unit": "m/s2"}
    with pytest.raises(
        InputError, match=r"mean specific force is 0.1961 m/s\^2 if --accel-unit m/s2 is right.* --incre"
    ):
        read(unit_file(tmp_path, gyro=RATE_HZ, accel=RATE_HZ), **units)
    with pytest.raises(InputError, match=r"490.3 m/s2; the largest plausible|without --increments fits"):
        read(unit_file(tmp_path), increments=True, **units)
    gyro = still(5000)[0]
    path = csv_file(tmp_path, rows_of([gyro / RATE_HZ]), comments=["# rate_hz: 50"], header="w_x,w_y,w_z")
    with pytest.raises(InputError, match=r"the mean angular rate is 0.3.* deg/h.*--increments fits"):
        read(path, gyro_unit="rad/s")


@pytest.mark.parametrize(("true", "declared"), [(STANDARD_GRAVITY, "m/s2"), (1.0, "g")])
def test_a_wrong_accelerometer_unit_is_found_out(tmp_path, true, declared):
    named = {"m/s2": "g", "g": "m/s2"}[declared]
    with pytest.raises(InputError, match=rf"{declared} is right; at rest it is gravity.*--accel-unit {named} fits"):
        read(unit_file(tmp_path, accel=true), gyro_unit="rad/s", accel_unit=declared)


def test_specific_force_without_gravity_is_refused(tmp_path):
    rates, forces = still(500)
    path = csv_file(tmp_path, rows_of([np.arange(500) / RATE_HZ, rates, forces + np.array([0, 0, STANDARD_GRAVITY])]))
    with pytest.raises(InputError, match=r"No other unit fits: has gravity been taken out"):
        read(path, axes="frd")


def test_columns_of_zeros_are_told_from_single_bad_rows(tmp_path):
    rates = still(500)[0]
    path = csv_file(tmp_path, rows_of([np.arange(500) / RATE_HZ, rates, np.zeros((500, 3))]))
    with pytest.raises(InputError, match=r"all exactly 0.*500 of 500 rows are like it.*--columns f_x=-,f_y=-,f_z=-"):
        read(path)
    assert read(path, columns={"f_x": "-", "f_y": "-", "f_z": "-"}).accel_b is None


@pytest.mark.slow
@pytest.mark.parametrize("bias_deg_h", [3, 30, 400, 12_000])
@pytest.mark.parametrize("direction", [(1, 1, 1), (1, -2, 0.5), (0, 0, -1)])
def test_a_poor_gyro_in_its_right_unit_is_let_through(tmp_path, bias_deg_h, direction):
    """Bias is for the validity limits of the heading to judge, not for the reader."""
    rates, forces = still(1000)
    bias = np.array(direction) / np.linalg.norm(direction) * bias_deg_h * DEG_PER_HOUR
    rates = rates + bias + np.random.default_rng(2).normal(0, 1e-3, (1000, 3))
    path = csv_file(tmp_path, rows_of([np.arange(1000) / RATE_HZ, np.degrees(rates), forces]), comments=[])
    recording = read(path, gyro_unit="deg/s", accel_unit="m/s2", latitude=LATITUDE)
    assert_allclose(recording.gyro_b, rates, rtol=1e-12)


def test_a_drive_in_part_of_the_recording_does_not_make_its_unit_implausible(tmp_path):
    rates, forces = still(3000)
    rates[2000:] += 0.3  # 17 deg/s in the last third
    path = csv_file(tmp_path, rows_of([np.arange(3000) / RATE_HZ, np.degrees(rates), forces]), comments=[])
    assert_allclose(read(path, gyro_unit="deg/s", accel_unit="m/s2").gyro_b, rates, rtol=1e-12)


def test_our_own_files_are_believed(tmp_path):
    """A simulated poor gyro of 57 times Earth rate looks like deg/s declared as rad/s."""
    rates = still(2000)[0] * (180 / pi)
    rows = rows_of([np.arange(2000) / RATE_HZ, rates])
    comments = ["# gyro_unit: rad/s", f"# rate_hz: {RATE_HZ}"]
    header = "t,w_x,w_y,w_z"
    with pytest.raises(InputError, match="--gyro-unit deg/s fits"):
        read(csv_file(tmp_path, rows, comments=comments, header=header))
    ours = ["# format: gyronorth.recording/1", *comments]
    assert np.linalg.norm(read(csv_file(tmp_path, rows, comments=ours, header=header)).gyro_b.mean(0)) > 50 * EARTH_RATE


def test_whole_numbers_too_large_for_their_unit_are_called_counts(tmp_path):
    rows = np.column_stack([np.arange(100) / RATE_HZ, np.tile([3, -2, 1, 0, 0, -16384], (100, 1))])
    path = tmp_path / "counts.csv"
    np.savetxt(path, rows, delimiter=",", header=",".join(TITLES), comments="")
    with pytest.raises(InputError, match=r"as counts are.*--gyro-scale and --accel-scale"):
        read(path, gyro_unit="deg/s", accel_unit="m/s2")
