"""What is known of the unit's bias: options of a known bias and of a deviation curve, and which do not go together."""

from __future__ import annotations

from dataclasses import replace
from math import degrees
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from gyronorth.catalogue import METHODS
from gyronorth.cli.options import SITE
from gyronorth.cli.parsers import DEG_PER_HOUR, triple

if TYPE_CHECKING:
    from gyronorth.deviation import DeviationModel
    from gyronorth.readers import ReadOptions

#: Why a known bias and a deviation curve do not go together.
TWICE = "the curve was measured with that bias in it and would correct it twice."

GyroBias = Annotated[
    Any,
    typer.Option(
        metavar="X,Y,Z",
        parser=triple("X,Y,Z in deg/h", "1.2,-0.4,0.3", scale=DEG_PER_HOUR),
        help="Known gyro bias in body axes, deg/h; subtracted.",
        rich_help_panel=SITE,
    ),
]
Deviation = Annotated[
    Path | None,
    typer.Option(
        metavar="PROFILE|BUNDLE",
        help="Deviation curve from `gyronorth calibrate`, or a bundle that carries one; applied in its session.",
        rich_help_panel=SITE,
    ),
]
AnySession = Annotated[
    bool,
    typer.Option(
        "--any-session", help="Apply the deviation curve in any session, not only its own.", rich_help_panel=SITE
    ),
]


def curve_and_method(
    path: Path | None, method: str, reading: ReadOptions, *, any_session: bool, biased: bool
) -> tuple[DeviationModel | None, str]:
    """The curve asked for, where it may be applied, and the method it corrects."""
    from gyronorth.errors import InputError

    if path is None:
        if any_session:
            raise InputError(
                "--any-session belongs to --deviation, which is not given. For a bundle that carries a correction, "
                "give --deviation BUNDLE/deviation.json --any-session."
            )
        return None, method
    if biased:
        raise InputError(f"--gyro-bias and --deviation were both given: {TWICE} Give one of them.")
    if method != "auto" and not any(info.name == method and info.corrected_by_deviation for info in METHODS):
        raise InputError(
            f"A deviation curve corrects the closed form, but the method is {method}. Use --method mean with it."
        )
    from gyronorth.deviation import ANY_SESSION, read_deviation

    curve = read_deviation(path / "deviation.json" if path.is_dir() else path)
    measured = reading.boresight if curve.boresight is None else curve.boresight
    if max(abs(theirs - ours) for theirs, ours in zip(measured, reading.boresight, strict=True)) > 1e-6:
        theirs, ours = (",".join(f"{degrees(angle):g}" for angle in each) for each in (measured, reading.boresight))
        raise InputError(
            f"{path.name} was measured with --boresight {theirs}, but this is {ours}: the curve holds for the headings "
            f"of that mounting. Give --boresight {theirs} here too, or calibrate anew."
        )
    return replace(curve, session=ANY_SESSION) if any_session else curve, "mean"


def check_bias(model: Path) -> None:
    """Refuse a known bias where a bundle brings a deviation curve."""
    from gyronorth.alignment.networks.bundle import read_bundle
    from gyronorth.errors import InputError

    if read_bundle(model).deviation is not None:
        raise InputError(
            f"--gyro-bias was given, and --model {model} carries a deviation curve: {TWICE} Leave --gyro-bias out, or "
            "give it with --method mean and no bundle."
        )
