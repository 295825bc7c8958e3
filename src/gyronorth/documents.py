"""The JSON documents that commands print, as types. `gyronorth.schemas` holds the JSON Schema made of each.

A field is never taken away or given another meaning within one version of a schema; new fields come at the end.
"""

from __future__ import annotations

from typing import Literal, NotRequired

from typing_extensions import TypedDict


class FindingDocument(TypedDict):
    """A reason or a warning."""

    code: str
    message: str
    value: float | None
    limit: float | None


class PoseDocument(TypedDict):
    """A stretch of standing still."""

    start_s: float
    end_s: float
    heading_deg: float | None


class OrientationDocument(TypedDict):
    """The attitude for estimators: body forward-right-down, n north-east-down; see `gyronorth.attitude`."""

    quaternion_nb_xyzw: list[float]
    matrix_nb: list[list[float]]
    covariance_n_rad2: list[list[float]] | None
    yaw_enu_deg: float


class DisturbanceDocument(TypedDict):
    """What a method that models disturbance found."""

    sway_tones: float
    settling: float
    tilt: float | None
    walk: float | None
    masked_s: float
    residual_ratio: float
    explained: bool
    drift_probability: float


class DensityDocument(TypedDict):
    """Density of the heading: angles evenly apart, clockwise."""

    heading_deg: list[float]
    density_per_deg: list[float]


class HeadingDocument(TypedDict):
    """`gyronorth heading --json`."""

    schema: Literal["gyronorth.heading/1"]
    heading_deg: float | None
    sigma_deg: float | None
    interval95_deg: list[float]
    valid: bool
    reasons: list[FindingDocument]
    warnings: list[FindingDocument]
    method: str
    method_reason: str
    bundle: str | None
    roll_deg: float | None
    pitch_deg: float | None
    latitude_deg: float | None
    sensor: str | None
    duration_s: float
    rate_hz: float
    end_time_utc: str | None
    poses: list[PoseDocument]
    sigma_parts_deg: dict[str, float | None]
    gyro_bias_deg_h: list[float] | None
    rate_mean_deg_h: list[float]
    rate_norm_deg_h: float
    implied_latitude_deg: float | None
    gyro_bias_sigma_deg_h: list[float] | None
    scale_factor_ppm: list[float] | None
    scale_factor_sigma_ppm: list[float] | None
    disturbance: DisturbanceDocument | None
    fitness: Literal["aligning", "degraded", "valid", "invalid"]
    orientation: OrientationDocument | None
    posterior: NotRequired[DensityDocument | None]


class PlanDocument(TypedDict):
    """`gyronorth plan --json`, without its optional list `turns`."""

    schema: Literal["gyronorth.plan/1"]
    sensor: str
    latitude_deg: float
    method: str
    useful_duration_s: float | None
    shortest_duration_s: float | None
    least_sigma_deg: float
    duration_s: list[float]
    sigma_deg: list[float]
    half_width95_deg: list[float]
    sigma_parts_deg: dict[str, list[float]]
    latitudes_deg: list[float]
    sigma_by_latitude_deg: list[list[float]]


class SwingRow(TypedDict):
    """One recording of a compass swing."""

    heading_true_deg: float
    error_deg: float
    left_out_error_deg: float
    left_out_sigma_deg: float


class CalibrationDocument(TypedDict):
    """`gyronorth calibrate --json`."""

    schema: Literal["gyronorth.calibration/1"]
    recordings: int
    session: str | None
    crmse_deg: float
    left_out_crmse_deg: float
    ratio: float
    curve_probability: float
    rows: list[SwingRow]


class AllanDocument(TypedDict):
    """`gyronorth allan --json`; `gyro` and `accel` hold curves and terms under keys with units."""

    schema: Literal["gyronorth.allan/1"]
    source: str
    duration_s: float
    rate_hz: float
    gyro: dict[str, object]
    accel: dict[str, object] | None
    turn_on_bias_deg_h: float
    notes: list[str]


class GapDocument(TypedDict):
    """Missing samples that were bridged."""

    start: float
    samples: int


class NoteDocument(TypedDict):
    """A remark of a reader; `blocking` ones want a declaration before a heading can be valid."""

    code: str
    message: str
    value: float | None
    limit: float | None
    blocking: bool


class ClockDocument(TypedDict):
    """What the time stamps show; None in `info` without a time column, and where not all of the file was read."""

    data_s: float
    lost: int
    late: int
    latest_s: float
    repeated: int
    duplicated: int
    backwards: int
    wraps: list[str]
    given_back: int
    scatter: float


class InfoDocument(TypedDict):
    """`gyronorth info --json`."""

    source: str
    format: str
    topic: str | None
    columns: list[str]
    rate_hz: float
    gyro_unit: str
    accel_unit: str | None
    axes: str
    axes_declared: bool
    increments: bool
    session: str | None
    start_time_utc: str | None
    latitude_deg: float | None
    heading_true_deg: float | None
    samples: int
    duration_s: float
    rate_mean_deg_h: list[float]
    rate_norm_deg_h: float
    rate_norm_earth_rates: float
    force_mean_m_s2: list[float] | None
    rows_dropped: int
    gaps: list[GapDocument]
    notes: list[NoteDocument]
    estimated_from: dict[str, object] | None
    read_as: str
    axes_origin: Literal["stated", "declared", "format", "assumed"]
    clock: ClockDocument | None
    schema: Literal["gyronorth.info/1"]


class LiveState(TypedDict):
    """What a live session says beside its heading; counters of its input follow."""

    state: Literal["waiting", "running", "stopped", "ended", "failed"]
    fitness: Literal["aligning", "degraded", "valid", "held", "invalid"]
    age_s: float | None
    held_s: float | None
    alignment_deg: float
    rate_of_turn_deg_min: float | None
    replay: bool
    source: str
    protocol: str | None
    connected: bool
    trouble: str | None
    recording: str | None
    raw_recording: str | None
    recording_error: str | None
    lines: int
    good: int
    garbage: int
    skipped_bytes: int
    other_frames: int
    implausible: int
    strays: int
    lost: int
    gaps: int
    connections: int
    reconnects: int
    stalls: int
    time_jumps: int
    restarts: int


class LiveDocument(TypedDict):
    """One line of `gyronorth live --json`: the fields of heading-1, once there is an estimate, and `live`."""

    live: LiveState


#: Name of a schema -> the type of its document.
DOCUMENTS: dict[str, type] = {
    "heading-1": HeadingDocument,
    "plan-1": PlanDocument,
    "calibration-1": CalibrationDocument,
    "allan-1": AllanDocument,
    "info-1": InfoDocument,
    "live-1": LiveDocument,
}
