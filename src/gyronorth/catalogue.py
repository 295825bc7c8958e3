"""The names that the package knows, as plain data: methods, findings, formats, kinds of disturbance.

It imports nothing heavy, so that `--help`, the enumerations of the command line, the documentation and the live page
can read it at no cost. A row says what is true of an entry; what it does stands in the module that the row names.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from typing import Literal


@dataclass(frozen=True)
class MethodInfo:
    """One way to find a heading, and its traits."""

    name: str
    summary: str  # one clause for --help
    module: str  # where its class `METHOD` stands
    needs_accelerometer: bool = False
    takes_attitude: bool = True  # False: a given roll and pitch is an error, never dropped
    takes_bundle: bool = False
    takes_turn_angles: bool = False
    corrected_by_deviation: bool = False  # a deviation curve corrects its heading
    lowest_rate_hz: float = 0.0
    shortest_s: float = 0.0
    longest_s: float = inf
    memory: Literal["all", "last_window"] = "all"  # what of a long stream it looks at
    batched: bool = False  # takes leading dimensions at once
    plannable: bool = False  # `plan` predicts its sigma
    least_poses: int = 1  # fewer tell it nothing
    level_in_heading: bool = True  # its heading is that of the mean rate: an error of level is in it
    along_time: str = "mean"  # method whose heading against time is drawn beside it
    gates: tuple[str, ...] = ("rate", "width", "motion")  # names of `alignment.judging.GATES` that judge its claim


#: Every method, in the order of --help.
METHODS: tuple[MethodInfo, ...] = (
    MethodInfo(
        "auto",
        "chooses by what the recording holds",
        "gyronorth.alignment.auto",
        takes_turn_angles=True,
    ),
    MethodInfo(
        "mean",
        "closed form from the mean rate and the mean specific force",
        "gyronorth.alignment.methods.mean",
        corrected_by_deviation=True,
        batched=True,
        plannable=True,
    ),
    MethodInfo(
        "inertial",
        "gravity followed in an inertial frame; for a swaying vehicle",
        "gyronorth.alignment.methods.inertial",
        needs_accelerometer=True,
        takes_attitude=False,
        batched=True,
        plannable=True,
        along_time="inertial",
    ),
    MethodInfo(
        "turned",
        "two or more poses and the turns between them (multi-position)",
        "gyronorth.alignment.methods.turned",
        takes_attitude=False,
        takes_turn_angles=True,
        least_poses=2,
        level_in_heading=False,
        along_time="turned",
        gates=("width",),
    ),
    MethodInfo(
        "posterior",
        "one pose, averaged over models of tilt, sway, settling and bumps",
        "gyronorth.alignment.methods.posterior",
    ),
    MethodInfo(
        "bayes",
        "exhaustive search of sway, settling and bumps, 30 to 300 s",
        "gyronorth.alignment.methods.bayes",
        lowest_rate_hz=3.0,
        shortest_s=30.0,
        longest_s=300.0,
        memory="last_window",
    ),
    MethodInfo(
        "learned",
        "the same, with a network that proposes candidates, from 30 s",
        "gyronorth.alignment.methods.learned",
        takes_bundle=True,
    ),
    MethodInfo(
        "paper",
        "the paper's denoiser and heading network",
        "gyronorth.alignment.methods.network",
        takes_bundle=True,
        memory="last_window",
        level_in_heading=False,
    ),
    MethodInfo(
        "baseline",
        "the paper's heading network without denoiser",
        "gyronorth.alignment.methods.network",
        takes_bundle=True,
        memory="last_window",
        level_in_heading=False,
    ),
)


def method_info(name: str) -> MethodInfo:
    """The row of a method; KeyError for a name that is none."""
    for info in METHODS:
        if info.name == name:
            return info
    raise KeyError(name)


@dataclass(frozen=True)
class FindingInfo:
    """One code of a reason, a warning or a note."""

    code: str
    kind: Literal["reason", "warning"]
    short: str  # words of the live page
    summary: str  # one sentence for people


#: Every code that an estimate or a live session may carry.
FINDINGS: tuple[FindingInfo, ...] = (
    FindingInfo("rate_norm", "reason", "the rate is not Earth rate", "The mean rate is not as large as the Earth's."),
    FindingInfo(
        "implied_latitude",
        "reason",
        "the rate does not fit the latitude",
        "The rate and the vertical imply another latitude than the one given.",
    ),
    FindingInfo(
        "motion",
        "reason",
        "the unit moved",
        "The unit moved, or its bias drifts, by more than the method allows.",
    ),
    FindingInfo("too_short", "reason", "too short", "The recording is too short for a heading."),
    FindingInfo("too_noisy", "reason", "too noisy", "The interval cannot tell north from south."),
    FindingInfo("near_pole", "reason", "too near to the pole", "The horizontal Earth rate is too small here."),
    FindingInfo("saturated", "reason", "the sensor is at its limit", "An output reached the end of its range."),
    FindingInfo("hung_axis", "reason", "an axis does not change", "An axis of the unit is dead, or hung for a while."),
    FindingInfo("gravity", "reason", "no gravity", "The accelerometer does not show gravity."),
    FindingInfo("gimbal", "reason", "points up or down", "The forward axis stands too steeply to have a heading."),
    FindingInfo("not_finite", "reason", "not a number", "What was worked out is no number."),
    FindingInfo(
        "network_contradicts", "reason", "network and Earth rate differ", "The network contradicts the mean rate."
    ),
    FindingInfo("sensor_fault", "reason", "the unit reports a fault", "The unit marks samples as not to be trusted."),
    FindingInfo("bundle_mismatch", "reason", "the network does not fit", "The recording does not fit the bundle."),
    FindingInfo("not_running", "reason", "stopped", "The live session is not running."),
    FindingInfo("source_ended", "reason", "the source has ended", "The source of the live session has ended."),
    FindingInfo("sigma_required", "reason", "not certain enough yet", "Sigma is larger than is required."),
    FindingInfo("stalled", "reason", "no data", "Nothing comes from the source."),
    FindingInfo("not_computed", "reason", "not computed", "The samples so far cannot be worked on."),
    FindingInfo("units_suspect", "reason", "units to be checked", "The declared units give no unit on Earth."),
    FindingInfo("gaps", "reason", "too many samples missing", "More samples are missing than may be bridged."),
    FindingInfo("axes_suspect", "warning", "axes to be declared", "Gravity does not lie along body down."),
    FindingInfo("axes_assumed", "warning", "axes assumed", "Neither the file nor an option states the axes."),
    FindingInfo("bias_unknown", "warning", "no profile", "The size of the gyro's errors is inferred."),
    FindingInfo("assumed_level", "warning", "taken as level", "There is no accelerometer and no given attitude."),
    FindingInfo("accelerometer_beside", "warning", "force left out", "A file of the accelerometer was left out."),
    FindingInfo("swaying", "warning", "swaying", "The attitude swayed, or its tilt changed."),
    FindingInfo("rows_dropped", "warning", "rows left out", "Rows that could not be read were left out."),
    FindingInfo("gaps_bridged", "warning", "samples bridged", "Samples were missing and are bridged."),
    FindingInfo("time_jitter", "warning", "uneven time stamps", "The time stamps scatter about an even grid."),
    FindingInfo("time_wraps", "warning", "clock wrapped", "The clock starts again from 0 at a known place."),
    FindingInfo(
        "rate_conflict", "warning", "two rates", "Clock, configuration, declaration or table tell other rates."
    ),
    FindingInfo("rate_assumed", "warning", "rate assumed", "The frames do not say at which rate they come."),
    FindingInfo("units_assumed", "warning", "units assumed", "The frames do not say in which units they are."),
    FindingInfo("range_assumed", "warning", "range assumed", "The frames do not say the accelerometer's range."),
    FindingInfo("force_left_out", "warning", "force left out", "Specific force comes far less often than the rate."),
    FindingInfo("force_paired", "warning", "averaged to the force", "Specific force comes less often than the rate."),
    FindingInfo("configuration_changed", "warning", "reconfigured", "The unit sent another configuration on the way."),
    FindingInfo("layout_changed", "warning", "other messages", "The unit sends other messages than at the start."),
    FindingInfo("rate_changed", "warning", "another rate", "The unit was set to another rate on the way."),
    FindingInfo("clock_set", "warning", "clock reset", "The unit or its clock was reset on the way."),
    FindingInfo("cut_off", "warning", "file cut off", "The file states more samples than it has."),
    FindingInfo("alignment_offset", "warning", "alignment offset set", "The heading is the vehicle's, not the unit's."),
    FindingInfo("deviation_applied", "warning", "deviation curve applied", "The heading carries a unit's correction."),
    FindingInfo("deviation_unused", "warning", "deviation curve unused", "A deviation curve was not applied."),
    FindingInfo("profile_scaled", "warning", "beyond its profile", "The unit behaves as several times its profile."),
    FindingInfo(
        "profile_bounds", "warning", "profile of bounds", "The profile holds upper bounds in place of figures."
    ),
    FindingInfo("coarse", "warning", "coarse output", "The rate is rounded to steps above its noise."),
    FindingInfo("frozen", "warning", "output does not change", "The gyro's output does not change for a while."),
    FindingInfo("simulated_noise", "warning", "simulated noise", "The biases are real, the noise is simulated."),
    FindingInfo("log_time_used", "warning", "recorder's time used", "The messages carry no time of their own."),
    FindingInfo("older_dropped", "warning", "older samples dropped", "Older samples are no longer used."),
    FindingInfo("older_merged", "warning", "older samples merged", "Older samples are kept as means."),
)

#: Codes that speak against a heading.
REASONS = frozenset(row.code for row in FINDINGS if row.kind == "reason")


@dataclass(frozen=True)
class FormatInfo:
    """One file format of recordings, and which declarations it takes."""

    name: str
    title: str  # for people
    module: str  # where its `FORMAT` stands, or `FORMATS` by name where a file holds several
    suffixes: tuple[str, ...] = ()  # that say the format; others are looked into
    written: tuple[str, ...] = ()  # suffixes under which it is written
    extra: str | None = None  # of the package, with the libraries that it needs
    takes_columns: bool = True
    takes_variable: bool = False
    takes_topic: bool = False


_FORMATS = "gyronorth.readers.formats."
#: Every format. What is looked into is tried in this order; CSV is what nothing else recognises.
FORMATS: tuple[FormatInfo, ...] = (
    FormatInfo("csv", "CSV", _FORMATS + "csv", (".csv",), (".csv",)),
    FormatInfo("psins", "PSINS .imu", _FORMATS + "psins", (".imu",)),
    FormatInfo("mt-manager", "MT Manager export", _FORMATS + "mt_manager"),
    FormatInfo("mat", "MATLAB .mat", _FORMATS + "mat", (".mat",), takes_variable=True),
    FormatInfo("npz", "NumPy .npz", _FORMATS + "npz", (".npz",), (".npz",), takes_variable=True),
    FormatInfo("npy", "NumPy .npy", _FORMATS + "npy", (".npy",)),
    FormatInfo("hdf5", "HDF5", _FORMATS + "hdf5", (".h5", ".hdf5"), (".h5", ".hdf5"), extra="io", takes_variable=True),
    FormatInfo("parquet", "Parquet", _FORMATS + "parquet", (".parquet",), (".parquet",), extra="io"),
    FormatInfo(
        "feather",
        "Feather",
        _FORMATS + "tables",
        (".feather", ".arrow", ".arrows", ".orc"),
        extra="io",
        takes_variable=True,
    ),
    FormatInfo("rosbag1", "ROS 1 bag", _FORMATS + "rosbag", (".bag",), (".bag",), "io", takes_topic=True),
    FormatInfo("rosbag2", "ROS 2 bag", _FORMATS + "rosbag", (".db3",), (), "io", takes_topic=True),
    FormatInfo("mcap", "MCAP", _FORMATS + "mcap", (".mcap",), (".mcap",), "io", takes_topic=True),
    FormatInfo("xlsx", "Excel .xlsx", _FORMATS + "workbook", (".xlsx",), extra="io", takes_variable=True),
    FormatInfo("miniseed", "miniSEED", _FORMATS + "miniseed", (".mseed", ".miniseed"), extra="io", takes_variable=True),
    FormatInfo("r", "data of R", _FORMATS + "r_data", (".rds", ".rda", ".rdata"), extra="r", takes_variable=True),
    FormatInfo("imr", "Inertial Explorer .imr", _FORMATS + "imr", (".imr",), takes_columns=False),
    FormatInfo("doubles", "binary rows of KF-GINS or PSINS", _FORMATS + "doubles", takes_columns=False),
    FormatInfo("frames", "capture of a unit's frames", _FORMATS + "frames", takes_columns=False),
)
#: Suffixes under which a recording is written.
WRITTEN_SUFFIXES = tuple(suffix for info in FORMATS for suffix in info.written)


@dataclass(frozen=True)
class KindInfo:
    """One kind of simulated disturbance: what `simulate --disturbance` takes."""

    name: str
    role: Literal["known", "slow", "held_out", "platform"]


#: known: training and priors know it. slow: a warm-up of minutes, which only the priors of recordings beyond 300 s
#: know. held_out: kept out of training and of every prior, a test of what nobody has modelled. platform: motion that
#: an accelerometer sees, or a turn in azimuth: `benchmark stress` measures what it costs.
DISTURBANCE_KINDS: tuple[KindInfo, ...] = (
    *(KindInfo(name, "known") for name in ("quiet", "sway", "shock", "warmup", "tilt", "mixed")),
    KindInfo("soak", "slow"),
    *(KindInfo(name, "held_out") for name in ("square", "ramp", "beat")),
    *(KindInfo(name, "platform") for name in ("wind", "lean", "nudge")),
)

KINDS = tuple(kind.name for kind in DISTURBANCE_KINDS if kind.role == "known")
SLOW = tuple(kind.name for kind in DISTURBANCE_KINDS if kind.role == "slow")
HELD_OUT = tuple(kind.name for kind in DISTURBANCE_KINDS if kind.role == "held_out")
PLATFORM = tuple(kind.name for kind in DISTURBANCE_KINDS if kind.role == "platform")


#: Sets of NMEA sentences that a running instrument sends: name -> what it holds.
NMEA_SETS = {
    "standard": "HETHS, HEHDT, HEROT",
    "ths": "HETHS, HEROT",
    "hdt": "HEHDT, HEROT",
    "octans": "HEHDT, PHTRO, PHTRH (heave empty), PHINF",
}
#: Estimators that `allan --export` writes a profile for.
ALLAN_EXPORTS = ("kalibr", "openvins", "kf-gins", "navtk")
