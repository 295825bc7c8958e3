"""MiniSEED, the format of seismic networks: one channel for each axis of a rotational sensor and an accelerometer.

The last two letters of a channel's code say what it measures: J is rotation rate, N acceleration; E, N, Z point east,
north and up, as built; 1, 2, 3 and X, Y, Z are three orthogonal axes of which the file says no more [1]_. Values are
counts of the digitiser, whose size stands in the station's own description, not in the file. The records of a channel
follow one another in any order; where all three have a sample there is a row, and a gap is a gap.

References
----------
.. [1] FDSN, SEED Reference Manual V2.4, 2012, Appendix A: channel naming; FDSN Source Identifiers 1.0.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gyronorth.errors import InputError
from gyronorth.readers.asking import ask
from gyronorth.readers.budget import check_claim
from gyronorth.readers.format import Format, format_info
from gyronorth.readers.joining import joined
from gyronorth.readers.library import errors_translated, library
from gyronorth.readers.options import ReadOptions, choose_columns
from gyronorth.readers.source import FORCES, RATES, TIME, Clock, Facts, Question, Source, blocks_of

#: Instrument codes of rotational sensors and of accelerometers.
INSTRUMENTS = {"J": RATES, "N": FORCES}
#: Components in the order of x, y, z, and the axes that they are; None where the file does not say.
COMPONENTS: tuple[tuple[str, str | None], ...] = (("ENZ", "rfu"), ("21Z", "rfu"), ("123", None), ("XYZ", None))
#: Rows of a block; most sources in one file.
BLOCK_ROWS, MOST_CHANNELS = 1 << 14, 200
#: Most that the sample of an axis may stand beside that of another, in sample intervals, and that their rates differ.
NEAR, SAME_RATE = 0.4, 1e-6
_V2, _V3 = re.compile(rb"[0-9 \x00]{6}[DRQM][ \x00][A-Za-z0-9 ]{12}"), b"MS\x03"


@dataclass(frozen=True)
class Channel:
    """One axis, before its samples are decoded."""

    station: str  # network, station and location with points between them
    code: str  # of the channel, three letters
    rate_hz: float  # Hz
    id: str  # as the library names it


def open_miniseed(path: Path, options: ReadOptions) -> Source:
    """Open a miniSEED file."""
    pymseed = library("pymseed", path.name, "miniSEED")
    with errors_translated(path.name, "miniSEED file"):
        channels = _channels(pymseed, path)
    named = _named(channels, path, options)
    needed = options.needed
    declared = {our: title for our, title in (options.columns or {}).items() if our != TIME}
    automatic, axes = ({}, None) if set(RATES) <= set(declared) else _automatic(named, path, options)
    chosen = _choose(named, {**automatic, **declared}, path.name, needed)
    axes = axes if not declared else None
    sensors = [_source(pymseed, path, chosen, ours, axes) for ours in (RATES, FORCES) if ours[0] in chosen]
    return sensors[0] if len(sensors) == 1 else replace(joined(*sensors), name=path.name)


def _channels(pymseed: Any, path: Path) -> list[Channel]:
    """The channels of a file; refused where they claim more samples than its size allows."""
    found, samples = [], 0
    with pymseed.MS3TraceList.from_file(str(path)) as traces:
        for trace in list(traces)[:MOST_CHANNELS]:
            samples += sum(segment.samplecnt for segment in trace)
            rates = {segment.samprate for segment in trace}
            network, station, location, code = pymseed.sourceid2nslc(trace.sourceid)
            if len(rates) > 1 and max(rates) - min(rates) > SAME_RATE * max(rates):
                listed = ", ".join(f"{rate:g}" for rate in sorted(rates)[:5])
                raise InputError(f"Channel {code} of {path.name} changes its rate: {listed} Hz. Split the file there.")
            place = ".".join((network, station, location))
            found.append(Channel(place, code, float(next(iter(rates))), trace.sourceid))
    check_claim(path.name, "its records", 8 * samples, path.stat().st_size)
    return found


def _named(channels: Sequence[Channel], path: Path, options: ReadOptions) -> dict[str, Channel]:
    """Channels by the shortest name that tells them apart, those of one station where it is declared."""
    variable = options.variable
    stations = list(dict.fromkeys(channel.station for channel in channels))
    if variable is not None and variable not in stations:
        raise InputError(f"{path.name} has no station {variable!r}; it holds {', '.join(stations[:12])}.")
    there = [channel for channel in channels if variable in (None, channel.station)]
    with_gyro = {channel.station for channel in there if channel.code[1:2] == "J"}
    if len(with_gyro) > 1:
        listed = ", ".join(sorted(with_gyro)[:8])
        says = f"{path.name} holds {len(with_gyro)} rotational sensors: {listed} (network.station.location)."
        raise ask(path.name, options, [Question(says, ("--variable", min(with_gyro)), certain=False)])
    codes = [channel.code for channel in there]
    return {c.code if codes.count(c.code) == 1 else f"{c.station}.{c.code}": c for c in there}


def _automatic(named: Mapping[str, Channel], path: Path, options: ReadOptions) -> tuple[dict[str, str], str | None]:
    """Our name -> channel, by instrument and component, and the axes that these are."""
    columns: dict[str, str] = {}
    axes: dict[str, str | None] = {}
    for instrument, ours in INSTRUMENTS.items():
        groups: dict[str, dict[str, str]] = {}
        for title, channel in named.items():
            if channel.code[1:2] == instrument:
                groups.setdefault(channel.station + channel.code[:1], {})[channel.code[2:]] = title
        whole = [(group, each) for group in groups.values() for each in COMPONENTS if set(each[0]) <= set(group)]
        if len(whole) > 1:
            listed = "; ".join(", ".join(group[k] for k in each[0]) for group, each in whole[:6])
            word = "rotational sensors" if ours == RATES else "accelerometers"
            first = _pairs(ours, [whole[0][0][letter] for letter in whole[0][1][0]])
            says = f"{path.name} holds {len(whole)} {word}: {listed}. Which one is meant?"
            raise ask(path.name, options, [Question(says, ("--columns", first), certain=False)])
        for group, (letters, known) in whole:
            columns |= dict(zip(ours, [group[letter] for letter in letters], strict=True))
            axes[instrument] = known
    if len(set(axes.values())) > 1:
        gyro = [columns[our] for our in RATES]
        accel = [columns[our] for our in FORCES]
        says = (
            f"{path.name} holds rotation rate as {', '.join(gyro)} and acceleration as {', '.join(accel)}: which axes "
            f"of the two are the same is not known. Name all six in one order: --columns {_pairs(RATES, gyro)},"
            f"{_pairs(FORCES, accel)}; or leave the accelerometer out."
        )
        alone = f"{_pairs(RATES, gyro)},{_pairs(FORCES, '---')}"
        raise ask(path.name, options, [Question(says, ("--columns", alone), certain=False)])
    return columns, next(iter(axes.values()), None)


def _pairs(ours: Sequence[str], titles: Sequence[str]) -> str:
    return ",".join(f"{our}={title}" for our, title in zip(ours, titles, strict=True))


def _choose(
    named: Mapping[str, Channel], columns: Mapping[str, str | int], name: str, needed: tuple[str, ...]
) -> dict[str, Channel]:
    if not any(our in columns for our in needed):
        listed = ", ".join(list(named)[:24]) or "no channel"
        kind = "rotation rate (HJE, HJN, HJZ or HJ1, HJ2, HJ3)" if needed == RATES else "acceleration (HNE, HNN, HNZ)"
        raise InputError(
            f"{name} holds {listed}; three channels of {kind} are expected in one file. Files of one channel each are "
            "put into one by writing them one behind another: cat *.mseed > all.mseed. Other codes are named with "
            f"--columns {_pairs(needed, ('CODE', 'CODE', 'CODE'))}."
        )
    titles = list(named)
    positions = choose_columns(titles, columns, {}, name, needed=needed)
    return {our: named[titles[position]] for our, position in positions.items()}


def _source(pymseed: Any, path: Path, chosen: Mapping[str, Channel], ours: tuple[str, ...], axes: str | None) -> Source:
    """The three channels of one sensor."""
    channels = [chosen[our] for our in ours]
    rates = [channel.rate_hz for channel in channels]
    if max(rates) - min(rates) > SAME_RATE * max(rates):
        listed = ", ".join(f"{channel.code} {channel.rate_hz:g} Hz" for channel in channels)
        raise InputError(f"The channels of {path.name} differ in rate: {listed}.")
    with errors_translated(path.name, "miniSEED file"):
        read = [_samples(pymseed, path, channel) for channel in channels]
    zero = min(int(start[0]) for start, _ in read)
    time, values = _rows(read, zero, rates[0], channels, path.name)
    table = np.column_stack([time, values])
    codes = ", ".join(channel.code for channel in channels)
    word = "gyro" if ours == RATES else "acceleration"
    clock = f"; clock: the record headers, {rates[0]:g} Hz" if ours == RATES else ""
    begins = zero + round(float(time[0]) * 1e9) if len(time) else zero
    return Source(
        format="miniseed",
        name=path.name if ours == RATES else f"{channels[0].station} in {path.name}",
        columns=(TIME, *ours),
        blocks=partial(_blocks, table),
        stated=Facts(start_time_utc=_utc(begins), rate_hz=rates[0]),
        usual=Facts(axes=axes),
        clock=Clock(1.0, name="the time of its records", zero=zero * 1e-9, known=True),
        read_as=f"{word}: {codes} of {channels[0].station}{clock}",
    )


def _samples(pymseed: Any, path: Path, channel: Channel) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Time, ns since 1970, and value of each sample of a channel, shapes (n,), in order of time."""
    times, values = [], []
    with pymseed.MS3TraceList.from_file(str(path), unpack_data=True, sourceid=channel.id) as traces:
        for segment in (segment for trace in traces for segment in trace):
            samples = np.array(segment.np_datasamples)
            if samples.dtype.kind not in "fi":
                raise InputError(f"Channel {channel.code} of {path.name} holds text; numbers are expected.")
            step = np.round(np.arange(len(samples)) * (1e9 / segment.samprate)).astype(np.int64)
            times.append(segment.starttime + step)
            values.append(samples.astype(np.float64))
    time, value = np.concatenate(times), np.concatenate(values)
    order = np.argsort(time, kind="stable")
    return time[order], value[order]


def _rows(
    read: Sequence[tuple[NDArray[np.int64], NDArray[np.float64]]],
    zero: int,
    rate_hz: float,
    channels: Sequence[Channel],
    name: str,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Times (n,), s from `zero` on, and values (n, 3) where all three axes have a sample."""
    first: NDArray[np.float64] = np.asarray((read[0][0] - zero) * 1e-9, dtype=np.float64)
    rows: list[NDArray[np.float64]] = []
    keep = np.ones(len(first), dtype=bool)
    for (stamp, value), channel in zip(read, channels, strict=True):
        time = (stamp - zero) * 1e-9
        step = np.diff(time)
        if (step < NEAR / rate_hz).any():
            at = _utc(int(stamp[np.argmax(step < NEAR / rate_hz)]))
            raise InputError(
                f"Records of channel {channel.code} of {name} overlap at {at}: the same samples stand in it twice, or "
                "two others at one time. Leave one of the records out."
            )
        near = np.clip(np.searchsorted(time, first), 1, len(time) - 1) if len(time) > 1 else np.zeros(len(first), int)
        near = np.where(abs(time[near - 1] - first) < abs(time[near] - first), near - 1, near)
        keep &= abs(time[near] - first) < NEAR / rate_hz
        rows.append(value[near])
    if not keep.any():
        codes = ", ".join(channel.code for channel in channels)
        raise InputError(f"Channels {codes} of {name} have no sample at the same time: they are not of one recording.")
    return first[keep], np.stack(rows, axis=1)[keep]


def _blocks(table: NDArray[np.float64]) -> Any:
    return blocks_of((table[start : start + BLOCK_ROWS] for start in range(0, len(table), BLOCK_ROWS)), len(table))


def _utc(nanoseconds: int) -> str:
    seconds, rest = divmod(nanoseconds // 1000, 1_000_000)
    return datetime.fromtimestamp(seconds, UTC).replace(microsecond=rest).isoformat().replace("+00:00", "Z")


def recognises(head: bytes) -> bool:
    """Whether a file begins with a record of miniSEED, version 2 or 3."""
    if head.startswith(_V3):
        return len(head) > 12
    year = int.from_bytes(head[20:22], "big") if len(head) > 48 else 0
    return bool(_V2.match(head)) and (1900 < year < 2100 or 1900 < int.from_bytes(head[20:22], "little") < 2100)


FORMAT = Format(format_info("miniseed"), open_miniseed, recognises=recognises, foreign=("pymseed",))
