"""The commands by task, with examples: what `gyronorth --help` and the end of every `--help` show."""

from __future__ import annotations

NORTH, SENSOR, RECORDING, RESEARCH = "Find north", "Know your sensor", "Recordings", "Train and reproduce"

#: Command -> (task, examples), in the order of the help.
ABOUT: dict[str, tuple[str, tuple[str, ...]]] = {
    "heading": (
        NORTH,
        (
            "gyronorth heading rec.npz --sensor sdc500",
            "gyronorth heading rec.csv --sensor stim300 --latitude 48.2 --gyro-unit deg/s --accel-unit g",
            "gyronorth heading rec.npz --sensor sdc500 --report heading.html --json",
            "gyronorth heading FOLDER --sensor sdc500 --csv headings.csv",
        ),
    ),
    "explain": (
        NORTH,
        ("gyronorth explain rec.npz --sensor sdc500", "gyronorth explain rec.csv --sensor stim300 --latitude 48.2"),
    ),
    "live": (
        NORTH,
        (
            "gyronorth live serial:/dev/ttyUSB0:115200 --sensor stim300 --latitude 48.2",
            "gyronorth live rec.csv --speed 10 --sensor stim300",
        ),
    ),
    "sensors": (SENSOR, ("gyronorth sensors", "gyronorth sensors --json")),
    "plan": (
        SENSOR,
        (
            "gyronorth plan --sensor sdc500 --latitude 32.11",
            "gyronorth plan --sensor stim300 --latitude 48.2 --turns 4 --plot plan.png",
        ),
    ),
    "allan": (SENSOR, ("gyronorth allan night.npz", "gyronorth allan night.npz --sensor stim300 -o my_unit.json")),
    "calibrate": (SENSOR, ("gyronorth calibrate FOLDER -o deviation.json --latitude 48.2",)),
    "info": (RECORDING, ("gyronorth info rec.npz", "gyronorth info rec.csv --json")),
    "convert": (
        RECORDING,
        ("gyronorth convert rec.bag -o rec.npz", "gyronorth convert rec.npz -o slow.csv --decimate-to 3"),
    ),
    "import": (
        RECORDING,
        ("gyronorth import run.csv -o run.npz", "gyronorth import run.csv --yes --axes rfu -o run.npz"),
    ),
    "simulate": (
        RECORDING,
        (
            "gyronorth simulate --sensor stim300 --latitude 48.2 --heading 120 --duration 120 --rate 25 --seed 7 "
            "-o rec.csv",
        ),
    ),
    "train": (RESEARCH, ("gyronorth train all --data FOLDER --latitude 32.11 -o my_bundle",)),
    "benchmark": (RESEARCH, ("gyronorth benchmark published -o results",)),
    "published": (RESEARCH, ("gyronorth published -o published",)),
}

#: Module of `gyronorth.cli` -> the commands that it defines: only that of the command that is called is loaded.
MODULES: dict[str, tuple[str, ...]] = {
    "benchmark_command": ("benchmark",),
    "calibrate_command": ("calibrate",),
    "explain_command": ("explain",),
    "heading_command": ("heading",),
    "import_command": ("import",),
    "live_command": ("live",),
    "published_command": ("published",),
    "recording_commands": ("simulate", "info", "convert"),
    "sensor_commands": ("sensors", "allan", "plan"),
    "train_command": ("train",),
}
