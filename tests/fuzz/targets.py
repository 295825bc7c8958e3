"""All that takes a stranger's bytes: recordings, frames and lines, profiles, curves, bundles, settings, checkpoints."""

from __future__ import annotations

import hashlib
import json
import shutil
from collections.abc import Iterator
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from threading import Event
from typing import Any
from unittest.mock import patch

import numpy as np
from fuzz.beside import beside
from fuzz.oracle import Target, of_file

import gyronorth
from gyronorth.alignment.networks.bundle import shipped_bundle
from gyronorth.deviation import fit_deviation
from gyronorth.errors import InputError
from gyronorth.estimate import HeadingEstimate
from gyronorth.live.events import Bytes, Connected, Emit, Ended, Lost
from gyronorth.live.lines import LineReader
from gyronorth.live.nmea_out import status_sentences
from gyronorth.live.session import LiveSettings, Session
from gyronorth.readers.options import ReadOptions
from gyronorth.recording import Recording

#: File name, content and the declarations it needs, of each.
Bases = list[tuple[str, bytes, dict[str, Any]]]

RATE_HZ, SAMPLES, LATITUDE = 1.0, 64, 0.5604


def targets(folder: Path) -> list[Target]:
    """Every target that the installed extras allow; they write to `folder`."""
    recording = _still()
    bases = _bases(folder)
    return [
        *_formats(recording, folder),
        *_layouts(bases, folder),
        _turned(folder),
        _preset(folder),
        *_options(folder),
        *_frames(folder),
        _profile(recording, folder),
        _deviation(recording, folder),
        *_bundles(folder),
        _lines(),
        *beside(bases, folder),
        *([_settings(folder)] if find_spec("yaml") else []),
        *([_checkpoint(folder)] if find_spec("torch") else []),
    ]


def _still() -> Recording:
    return gyronorth.simulate(
        "sdc500",
        latitude=LATITUDE,
        heading=0.7,
        duration=SAMPLES / RATE_HZ,
        rate_hz=RATE_HZ,
        rng=np.random.default_rng(1),
    )


def _formats(recording: Recording, folder: Path) -> Iterator[Target]:
    def heading(path: Path) -> HeadingEstimate:
        columns = {f"w_{axis}": str(i) for i, axis in enumerate("xyz")} if path.suffix == ".mat" else {}
        declared = {"columns": columns, "rate_hz": RATE_HZ, "gyro_unit": "rad/s", "axes": "frd"} if columns else {}
        found = gyronorth.read(path, **declared)
        return gyronorth.heading(found, latitude=found.latitude or LATITUDE, method="mean")

    suffixes = [".csv", ".npz"]
    suffixes += [".h5"] if find_spec("h5py") else []
    suffixes += [".parquet"] if find_spec("pyarrow") else []
    suffixes += [".bag"] if find_spec("rosbags") else []
    suffixes += [".mcap"] if find_spec("rosbags") and find_spec("mcap") else []
    for suffix in suffixes:
        path = folder / f"honest{suffix}"
        gyronorth.write(recording, path)
        kind = "text" if suffix == ".csv" else "binary"
        yield Target(suffix[1:], kind, path.read_bytes, of_file(folder, f"mutated{suffix}", heading))
    from scipy.io import savemat

    for compressed in (False, True):
        savemat(folder / "honest.mat", {"imu": recording.gyro_b}, do_compression=compressed)
        content = partial(bytes, (folder / "honest.mat").read_bytes())
        yield Target("mat-packed" if compressed else "mat", "binary", content, of_file(folder, "mutated.mat", heading))


def _bases(folder: Path) -> Bases:
    """Every other way in which people keep recordings."""
    needed = ("openpyxl", "pyarrow", "zstandard", "pymseed", "rdata", "rosbags", "mcap", "h5py")
    if not all(find_spec(each) for each in needed):
        return []
    from fuzz.recordings import base_files

    return base_files(folder)


def _layouts(bases: Bases, folder: Path) -> Iterator[Target]:
    for name, content, declared in bases:

        def heading(path: Path, declared: dict[str, Any] = declared) -> HeadingEstimate:
            found = gyronorth.read(path, drop_bad_rows=path.stat().st_size % 2 == 1, **declared)
            return gyronorth.heading(found, latitude=LATITUDE, method="mean")

        is_text = name.endswith(TEXTS) or name == "text.rds"
        kind = "json" if name.endswith(".json") else "text" if is_text else "binary"
        yield Target(name.replace(".", "-"), kind, partial(bytes, content), of_file(folder, name, heading))


#: Of the layouts, those that are texts in UTF-8.
TEXTS = (".csv", ".txt", ".log", ".jsonl", ".imu")


def _turned(folder: Path) -> Target:
    """One of three poses in files of their own."""
    poses = [
        gyronorth.simulate(
            "stim300", latitude=LATITUDE, heading=0.7 + turn, duration=60.0, rate_hz=2.0, rng=np.random.default_rng(3)
        )
        for turn in (0.0, np.pi / 2, np.pi)
    ]
    path = folder / "pose.csv"
    gyronorth.write(poses[1], path)

    def use(file: Path) -> HeadingEstimate:
        given = [poses[0], gyronorth.read(file), poses[2]]
        return gyronorth.heading(given, latitude=LATITUDE, sensor="stim300", turn_angles=(np.pi / 2, np.pi / 2))

    return Target("turned", "text", partial(bytes, path.read_bytes()), of_file(folder, "pose-mutated.csv", use))


def _preset(folder: Path) -> Target:
    """Declarations that `import` keeps, for a file of the titles they name."""
    titles = ("Time", "gx", "gy", "gz", "ax", "ay", "az")
    names = ("t", "w_x", "w_y", "w_z", "f_x", "f_y", "f_z")
    path = folder / "of-preset.csv"
    recording = _still()
    table = np.column_stack([np.arange(SAMPLES) / RATE_HZ, recording.gyro_b, recording.accel_b])
    np.savetxt(path, table, delimiter=",", header=",".join(titles), comments="")
    document = {
        "title": "mine", "titles": ["Time"], "preamble": "", "file": "", "time_unit": "s", "gyro_unit": "rad/s",
        "accel_unit": "m/s2", "gyro_scale": 1.0, "axes": "frd", "columns": dict(zip(names, titles, strict=True)),
    }  # fmt: skip

    def use(file: Path) -> HeadingEstimate:
        return gyronorth.heading(gyronorth.read(path, preset=str(file)), latitude=LATITUDE, method="mean")

    return Target("preset", "json", partial(bytes, json.dumps(document).encode()), of_file(folder, "preset.json", use))


class _BeginsError(Exception):
    """The options were taken, and the session would begin."""


def _options(folder: Path) -> Iterator[Target]:
    """A file of options for `live`: what it says is checked as the command line is."""
    from typer.testing import CliRunner

    from gyronorth.cli import app

    text = (
        'source = "-"\naxes = "frd"\ngyro-unit = "rad/s"\naccel-unit = "m/s2"\nrate = 10.0\nlatitude = 32.11\n'
        'method = "mean"\npage = false\njson = true\nrequire-sigma = 2.0\noutput_rate = 0.5\n'
        "boresight = [0.1, 0, 0]\ncolumns = {t = 0, w_x = 1, w_y = 2, w_z = 3}\n"
    )

    def use(file: Path) -> None:
        with patch("gyronorth.live.session.Session.start", side_effect=_BeginsError):
            result = CliRunner().invoke(app, ["live", "--config", str(file)], input="")
        if result.exit_code == 2:
            raise InputError(result.output)
        if not isinstance(result.exception, _BeginsError):
            raise result.exception or AssertionError(result.output)

    yield Target("options", "text", partial(bytes, text.encode()), of_file(folder, "live.toml", use))


def _frames(folder: Path) -> Iterator[Target]:
    """Captures of every protocol: as files, and as they come to a running session."""
    from frames.encoders import CASES

    for name, make in CASES.items():
        case = make(40)
        declared: dict[str, Any] = {"protocol": case.protocol, "axes": "frd"}
        declared |= {"rate_hz": case.options.rate_hz, "imu": case.options.imu, "gyro_unit": case.options.gyro_unit}
        declared["increments"] = case.options.increments

        def heading(path: Path, declared: dict[str, Any] = declared) -> HeadingEstimate:
            found = gyronorth.read(path, format="frames", **declared)
            return gyronorth.heading(found, latitude=LATITUDE, method="mean")

        def live(content: bytes, declared: dict[str, Any] = declared) -> HeadingEstimate | None:
            return _session(content, ReadOptions(latitude=LATITUDE, **declared))

        content = partial(bytes, case.preamble + b"".join(case.frames))
        yield Target(f"frames-{name}", "binary", content, of_file(folder, f"{name}.bin", heading))
        yield Target(f"live-{name}", "binary", content, live)


class _Bytes:
    """A source that gives its bytes in pieces of odd sizes, with a break in between."""

    name, live = "fuzz", True

    def __init__(self, content: bytes) -> None:
        self._content = content

    def run(self, emit: Emit, stop: Event) -> None:
        emit(Connected(False))
        size = 1 + len(self._content) % 997
        for number, start in enumerate(range(0, len(self._content), size)):
            if number == 7:
                emit(Lost("unplugged"))
                emit(Connected(True))
            emit(Bytes(self._content[start : start + size]))
        emit(Ended())


def _session(content: bytes, reading: ReadOptions) -> HeadingEstimate | None:
    """What a session makes of a stream: its heading at the end, and what a receiver is told, must be sound."""
    session = Session(_Bytes(content), LiveSettings(reading, method="mean"))
    with patch("gyronorth.live.estimation._warm"):  # of no use to a stream of a second
        session.start()
        assert session.ended.wait(90), "the session does not end"
        session.close()
    if session.error is not None:
        raise session.error
    status = session.status
    sentences = status_sentences(status)
    assert "HDT" not in sentences, "a heading of a stream that has ended"
    return status.measured


def _profile(recording: Recording, folder: Path) -> Target:
    path = folder / "profile-honest.json"
    gyronorth.write_sensor(gyronorth.read_sensor("stim300"), path)
    take = of_file(folder, "profile.json", lambda file: gyronorth.heading(recording, sensor=str(file), method="mean"))
    return Target("profile", "json", path.read_bytes, take)


def _deviation(recording: Recording, folder: Path) -> Target:
    rng = np.random.default_rng(2)
    truth = np.linspace(0, 2 * np.pi, 9)[:-1]
    heading = truth + 0.05 * np.sin(truth) + rng.normal(0, 0.01, 8)
    path = folder / "deviation-honest.json"
    fit_deviation(heading, rng.normal(0, 0.02, 8), truth, session="*", duration=100.0, latitude=LATITUDE).write(path)

    def use(file: Path) -> HeadingEstimate:
        return gyronorth.heading(recording, method="mean", deviation=gyronorth.read_deviation(file))

    return Target("deviation", "json", path.read_bytes, of_file(folder, "deviation.json", use))


def _bundles(folder: Path) -> Iterator[Target]:
    """Each shipped bundle: its description and its networks, on a recording of which it gives a valid heading."""
    if not find_spec("onnxruntime"):
        return
    recording = gyronorth.simulate(
        "sdc500", latitude=LATITUDE, heading=0.7, duration=100.0, rate_hz=3.0, rng=np.random.default_rng(1)
    )
    for name in ("baseline", "learned", "paper"):
        made = folder / f"bundle-{name}"
        shutil.copytree(shipped_bundle(name), made)
        honest = {path.name: path.read_bytes() for path in made.iterdir()}

        def heading(changed: dict[str, bytes], name: str = name, made: Path = made) -> HeadingEstimate:
            for file, content in changed.items():
                (made / file).write_bytes(content)
            return gyronorth.heading(recording, method=name, sensor="sdc500", model=made)

        def described(content: bytes, take: Any = heading, honest: Any = honest) -> HeadingEstimate:
            return take({**honest, "bundle.json": content})

        yield Target(f"bundle-{name}", "json", partial(bytes, honest["bundle.json"]), described)
        for part, said in json.loads(honest["bundle.json"]).items():
            if not (isinstance(said, dict) and "sha256" in said):
                continue

            def run(content: bytes, part: str = part, take: Any = heading, honest: Any = honest) -> HeadingEstimate:
                info = json.loads(honest["bundle.json"])
                info[part]["sha256"] = hashlib.sha256(content).hexdigest()
                return take({**honest, "bundle.json": json.dumps(info).encode(), info[part]["file"]: content})

            yield Target(f"network-{name}-{part}", "binary", partial(bytes, honest[said["file"]]), run)


def _lines() -> Target:
    def take(content: bytes) -> None:
        reader = LineReader("stream", ReadOptions(rate_hz=10.0, gyro_unit="rad/s", accel_unit="m/s2", axes="frd"))
        for start in range(0, len(content), 997):
            for batch in reader.push(content[start : start + 997]):
                assert batch.rows.values.ndim == 2
        reader.end()

    rows = "".join(f"{k / 10:.1f},1e-5,-2e-5,-3e-5,0.01,0.02,-9.8\n" for k in range(200))
    return Target("lines", "text", f"# rate_hz: 10\nt,w_x,w_y,w_z,f_x,f_y,f_z\n{rows}".encode, take)


def _settings(folder: Path) -> Target:
    path = folder / "settings-honest.yaml"

    def honest() -> bytes:
        from gyronorth.learn.settings import paper, write_settings

        write_settings(paper(), path)
        return path.read_bytes()

    def use(file: Path) -> None:
        from gyronorth.learn.settings import read_settings

        read_settings(file)

    return Target("settings", "text", honest, of_file(folder, "settings.yaml", use))


def _checkpoint(folder: Path) -> Target:
    path = folder / "honest.pt"

    def honest() -> bytes:
        import torch

        torch.save({"fingerprint": "f", "weights": {"w": torch.zeros(4, 4)}, "epoch": 1}, path)
        return path.read_bytes()

    def use(file: Path) -> None:
        from gyronorth.learn.training import read_checkpoint

        read_checkpoint(file, "f")

    return Target("checkpoint", "binary", honest, of_file(folder, "mutated.pt", use))
