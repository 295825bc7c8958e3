"""gyronorth explain: every check of a heading, with its value, its limit and the formula of both."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gyronorth.cli.app import app
from gyronorth.cli.correction import AnySession, Deviation, GyroBias, check_bias, curve_and_method
from gyronorth.cli.options import (
    Json,
    MethodName,
    Model,
    Pitch,
    RequireSigma,
    Roll,
    SensorName,
    TurnAngles,
    TurnAngleSigma,
    attitude_given,
)
from gyronorth.cli.outputs import print_json
from gyronorth.cli.progress import reading_file, working
from gyronorth.cli.reading_options import with_reading

if TYPE_CHECKING:
    from gyronorth.readers import ReadOptions


@app.command()
@with_reading
def explain(
    source: Annotated[Path, typer.Argument(metavar="FILE", help="A recording.")],
    sensor: SensorName = None,
    method: MethodName = "auto",
    as_json: Json = False,
    gyro_bias: GyroBias = None,
    roll: Roll = None,
    pitch: Pitch = None,
    model: Model = None,
    turn_angles: TurnAngles = None,
    turn_angle_sigma_deg: TurnAngleSigma = None,
    deviation: Deviation = None,
    any_session: AnySession = False,
    require_sigma: RequireSigma = None,
    *,
    reading: ReadOptions,
) -> int:
    """Show why a heading is valid or refused: each check with its value, its limit and its formula.

    Give it the options that `heading` was given.

    Exit code 0: a valid heading. 2: bad input. 3: a heading that is refused.
    """
    from gyronorth.many import Request
    from gyronorth.report.checks import print_checks
    from gyronorth.sensor import read_sensor

    attitude, biased = attitude_given(roll, pitch), gyro_bias is not None
    curve, method = curve_and_method(deviation, method, reading, any_session=any_session, biased=biased)
    if biased and model is not None:
        check_bias(model)
    request = Request(
        reading,
        None if sensor is None else read_sensor(sensor),
        method,
        gyro_bias,
        attitude,
        model,
        turn_angles,
        curve,
        require_sigma,
        turn_angle_sigma_deg,
    )
    with reading_file(source) as progress:
        recording = request.read(source, progress)
    with working("finding north"):
        estimate = request.heading(recording)
    if as_json:
        print_json(
            {"valid": estimate.valid, "method": estimate.method, "checks": [c.to_json() for c in estimate.checks]}
        )
    else:
        print_checks(estimate, sys.stdout)
    return 0 if estimate.valid else 3
