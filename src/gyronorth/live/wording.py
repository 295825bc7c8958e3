"""The texts of the page: verdict, lights, turning, counters, as small pieces of HTML. Everything foreign is escaped."""

from __future__ import annotations

from html import escape

from gyronorth.angles import DEG_PER_HOUR
from gyronorth.catalogue import FINDINGS
from gyronorth.estimate import HeadingEstimate
from gyronorth.live.drawing import compass, quadrants
from gyronorth.live.status import NO_FIX, Status
from gyronorth.report.dial import quadrant_seconds
from gyronorth.report.wording import duration_text, heading_text, interval_text, number_text

#: What a light shows: class -> sign. The signs differ in shape, not in colour alone.
SIGNS = {"ok": "✓", "care": "▲", "bad": "✕", "off": "○"}
#: How the verdict looks: fitness -> class, sign. Only a heading that is valid or held is not struck out.
LOOKS = {
    "valid": ("valid", "✓"),
    "held": ("held", "▲"),
    "aligning": ("invalid short", "…"),
    "degraded": ("invalid short", "▲"),
    "invalid": ("invalid", "✕"),
}
#: Codes of findings in the words of the verdict.
SHORT = {row.code: row.short for row in FINDINGS}
#: A turned unit that has stood for less than this, s, is still turning or settling.
SETTLING = 2.0


def verdict_short(status: Status) -> str:
    """Valid or not and why, in a few words."""
    estimate = status.estimate
    if status.state == "failed":
        return f"stopped: {status.message}"
    if estimate is None:
        return "aligning: too short" if status.state == "running" else "no heading yet"
    if estimate.valid and status.held is not None:
        return f"held: carried on by the gyro for {status.held.since:.0f} s"
    if estimate.valid:
        return "valid"
    word = status.fitness
    return f"{word}: " + ", ".join(dict.fromkeys(SHORT.get(reason.code, reason.code) for reason in estimate.reasons))


def verdict(status: Status, wait: str = "") -> str:
    """The verdict with the heading and the rose; `wait` says how long it takes to be good enough."""
    estimate, short = status.estimate, verdict_short(status)
    if estimate is None:
        kind, sign, big = "none", "…", "---.-°"
        lines = ["Waiting for data." if status.state == "waiting" else ""]
        if status.state == "running":
            done = f" {status.seconds:.0f} s so far." if status.seconds else ""
            lines = [f"Looking at the first samples.{done}"]
    else:
        kind, sign = LOOKS[status.fitness]
        big = "---.-°" if estimate.heading is None else f"{heading_text(_deg(estimate.heading), decimals=1, width=5)}°"
        lines = [wait, *_estimate_lines(estimate)]
        if status.rate_of_turn is not None and status.state == "running":
            turn = _deg(status.rate_of_turn) * 60
            side = "" if abs(turn) < 0.05 else " to starboard" if turn > 0 else " to port"
            lines.insert(1, f"Rate of turn: {abs(turn):.1f}° a minute{side}")
        if status.age is not None:
            lines.append(f"Age of the estimate: {duration_text(float(round(status.age)))}")
    text = "".join(f"<p>{escape(line)}</p>" for line in lines if line)
    return (
        f'<section class="verdict {kind}" data-fitness="{status.fitness}"><div>'
        f'<p class="mark" data-verdict>{sign} {escape(_sentence(short))}</p>'
        f'<div class="big"><b data-heading>{big}</b> <small>true</small></div>{text}</div>'
        f'<div class="rose">{compass(status)}</div></section>'
    )


def _estimate_lines(estimate: HeadingEstimate) -> list[str]:
    doc = estimate.to_json()
    lines = []
    if doc["sigma_deg"] is not None:
        lines.append(
            f"± {number_text(doc['sigma_deg'])}° (1 sigma); 95 %: {interval_text(doc['interval95_deg'], unit='°')}"
        )
    lines.append(f"{duration_text(estimate.duration)} used, method {estimate.method} ({estimate.method_reason})")
    if doc["roll_deg"] is not None:
        roll, pitch = (round(doc[name], 2) + 0.0 for name in ("roll_deg", "pitch_deg"))  # no -0.00
        lines.append(f"roll {roll:.2f}°, pitch {pitch:.2f}°")
    return lines


def lights(status: Status) -> str:
    """Data, motion, validity and recording, each with its reasons."""
    return "".join(_light(*light) for light in (_data(status), _motion(status), _validity(status), _recording(status)))


def _light(name: str, kind: str, word: str, details: list[str]) -> str:
    more = "".join(f"<span>{escape(detail)}</span>" for detail in details)
    return (
        f'<div class="light {kind}"><div class="sign" aria-hidden="true">{SIGNS[kind]}</div>'
        f"<div><b>{escape(name)}: {escape(word)}</b>{more}</div></div>"
    )


def _data(status: Status) -> tuple[str, str, str, list[str]]:
    details = [status.source]
    if status.protocol not in ("", "lines"):
        details.append(f"frames: {status.protocol}")
    if status.rate_hz is not None:
        details.append(f"{status.rate_hz:g} Hz")
    if status.message:
        details.append(status.message)
    if status.state in ("ended", "stopped", "failed"):
        return "Data", "off" if status.state != "failed" else "bad", status.state, details
    if status.trouble == "connecting":
        return "Data", "care", "connecting", details
    if status.trouble.startswith(NO_FIX):
        return "Data", "care", "waiting for a fix", [*details, f"{_sentence(status.trouble)}."]
    if status.trouble:
        word = "no data" if "stalled" in status.trouble else "connection lost"
        details.append(f"{status.trouble}, silent for {status.silent:.0f} s; it is tried again.")
        return "Data", "bad" if status.state == "running" else "care", word, details
    return "Data", "ok", "receiving", details


def _motion(status: Status) -> tuple[str, str, str, list[str]]:
    estimate = status.estimate
    if estimate is None:
        return "Motion", "off", "not known yet", []
    if status.trouble:
        return "Motion", "off", "not known", []
    if status.held is not None:
        return "Motion", "care", "moved", [f"Last stood still {duration_text(round(status.held.since, 0))} ago."]
    moved = [finding.message for finding in estimate.reasons if finding.code == "motion"]
    if moved:
        return "Motion", "bad", "moved", moved
    if estimate.poses and estimate.duration - estimate.poses[-1].end > SETTLING:
        return "Motion", "care", "turning", [f"Last stood still until {estimate.poses[-1].end:.0f} s."]
    swayed = [finding.message for finding in estimate.warnings if finding.code == "swaying"]
    if swayed:
        return "Motion", "care", "swaying", swayed
    return "Motion", "ok", "still", []


def _validity(status: Status) -> tuple[str, str, str, list[str]]:
    estimate = status.estimate
    if estimate is None:
        return "Heading", "off", "none yet", []
    warnings = [finding.message for finding in estimate.warnings if finding.code != "swaying"]
    if estimate.valid and status.held is not None:
        return "Heading", "care", "held", ["It is carried on by the gyro until the unit stands still again.", *warnings]
    if estimate.valid:
        return "Heading", "ok", "valid", warnings
    reasons = [
        "The unit moved." if finding.code == "motion" else finding.message  # the other light says how
        for finding in estimate.reasons
    ]
    return "Heading", "bad", "must not be used", reasons + warnings


def _recording(status: Status) -> tuple[str, str, str, list[str]]:
    if status.recording_error is not None:
        return "Recording", "bad", "incomplete", [status.recording_error]
    if status.recording is None and status.saving:
        return "Recording", "off", status.state, ["The file is made with the first good row; none has come yet."]
    if status.recording is None:
        return "Recording", "care", "off", ["Start with --save FILE.csv to keep the samples."]
    size = f"{status.recording_bytes / 1e6:.1f} MB"
    if status.state == "running":
        return "Recording", "ok", "on", [f"{status.recording.name}, {size}"]
    return "Recording", "off", status.state, [f"{status.recording.name}, {size}"] if status.recording_bytes else []


def turning(status: Status) -> str:
    """Poses, quadrants, and what to do next."""
    estimate = status.estimate
    poses = () if estimate is None else estimate.poses
    if estimate is None or not poses:
        return "<p>Let the unit stand still. When the first pose is long enough, turn it by 180°.</p>"
    standing = poses[-1].end - poses[-1].start
    lines = []
    if estimate.duration - poses[-1].end > SETTLING:
        lines.append(f"<b>Turning.</b> Pose {len(poses)} lasted {standing:.0f} s.")
    else:
        lines.append(f"<b>Pose {len(poses)}</b>: standing for {standing:.0f} s.")
    if len(poses) == 1:
        lines.append(
            "One pose cannot tell the gyro's bias from Earth rate. Turn the unit by 180° and let it stand as long "
            "again."
        )
    elif estimate.gyro_bias is not None:
        bias = ", ".join(number_text(value / DEG_PER_HOUR) for value in estimate.gyro_bias)
        lines.append(f"Gyro bias found: {bias} deg/h.")
    text = "".join(f"<p>{line}</p>" for line in lines)
    turned = "".join(f"<li>{_deg(turn.angle):+.1f}° at {turn.start:.0f} s</li>" for turn in estimate.turns[-4:])
    turned = f"<p>Turns:</p><ul>{turned}</ul>" if turned else ""
    return f'<div class="turns"><div>{quadrants(quadrant_seconds(poses))}</div><div>{text}{turned}</div></div>'


def counters(status: Status) -> str:
    """Input statistics: what was read, and what went wrong."""
    count = status.counters
    rows = [
        ("good rows", count.good, False),
        ("lost samples (bridged)", f"{count.lost} in {count.gaps} gaps", count.lost > 0),
        ("garbage lines", count.garbage, count.garbage > 0),
        ("bytes of no whole frame", count.skipped_bytes, count.skipped_bytes > 0),
        ("frames of other messages", count.other_frames, False),
        ("implausible rows", count.implausible, count.implausible > 0),
        ("repeated or misplaced time stamps", count.strays, count.strays > 0),
        ("clock jumps", count.time_jumps, count.time_jumps > 0),
        ("reconnects", count.reconnects, count.reconnects > 0),
        ("stalls", count.stalls, count.stalls > 0),
        ("restarts", count.restarts, count.restarts > 0),
    ]
    body = "".join(
        f'<tr{" class=care" if care else ""}><th scope="row">{name}</th><td>{value}</td></tr>'
        for name, value, care in rows
    )
    last = (
        f'<p class="faint">Last bad line: <code>{escape(status.last_garbage)}</code></p>' if status.last_garbage else ""
    )
    return f"<table>{body}</table>{last}"


def marks(status: Status) -> str:
    """The latest moments that the user marked."""
    listed = "".join(f"<li>{mark.time:.1f} s {escape(mark.text)}</li>" for mark in status.marks[-5:])
    return f"<section><p>Marks:</p><ul>{listed}</ul></section>" if listed else ""


def targets(status: Status) -> str:
    """Where the sentences go."""
    listed = "".join(f"<li>{escape(target)}</li>" for target in status.targets)
    return f"<section data-targets><p>Sentences go to:</p><ul>{listed}</ul></section>" if listed else ""


def _sentence(text: str) -> str:
    return text[:1].upper() + text[1:]


def _deg(angle: float) -> float:
    return angle / (3600 * DEG_PER_HOUR)
