"""Second opinions in the report."""

import numpy as np

import gyronorth as gn
from gyronorth.report.comparison import opinions


def recording(**options):
    return gn.simulate(
        "isa100c", latitude=0.8, heading=1.0, duration=60, rate_hz=5, rng=np.random.default_rng(1), **options
    )


def test_the_report_has_the_quick_methods_beside_the_estimate():
    still = recording()
    estimate = gn.heading(still, sensor="isa100c")
    found = opinions(still, estimate, sensor=gn.read_sensor("isa100c"))
    assert [each.method for each in found] == ["posterior", "mean", "inertial"]
    assert found[0].heading_deg == estimate.to_json()["heading_deg"]
    assert all(abs(each.heading_deg - np.degrees(1.0)) < 3 for each in found)


def test_no_inertial_without_an_accelerometer_and_nothing_beside_poses():
    bare = recording(accel=False)
    estimate = gn.heading(bare, sensor="isa100c", attitude=(0.0, 0.0), method="mean")
    assert [each.method for each in opinions(bare, estimate, attitude=(0.0, 0.0))] == ["mean"]
    turned = recording(motion=gn.Motion(turns=((28.0, 4.0, np.pi),)))
    estimate = gn.heading(turned, sensor="isa100c")
    assert [each.method for each in opinions(turned, estimate)] == ["turned"]
