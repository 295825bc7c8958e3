"""What the command line says of itself: help by task, examples, names that are nearly right, completion."""

import re
import shlex

import pytest
from click import Context
from typer.testing import CliRunner

from gyronorth.catalogue import METHODS
from gyronorth.cli import app, completion
from gyronorth.cli.app import commands
from gyronorth.cli.tasks import ABOUT, MODULES
from gyronorth.errors import did_you_mean
from gyronorth.frames.catalogue import NAMES
from gyronorth.readers.axes import mat_bf
from gyronorth.readers.options import ReadOptions
from gyronorth.sensor import read_sensor

COMMANDS = commands()


def run(*arguments):
    return CliRunner().invoke(app, [*arguments])


def test_bare_call_prints_the_help_and_succeeds():
    bare = run()
    assert bare.exit_code == 0
    assert bare.stdout == run("--help").stdout
    assert "Find north" in bare.stdout


def test_every_command_has_a_task_and_examples_and_stands_in_their_order():
    assert set(ABOUT) == set(COMMANDS)
    shown = run("--help").stdout
    places = [re.search(rf"^\W*{name} ", shown, re.MULTILINE) for name in ABOUT]
    assert None not in places
    assert [place.start() for place in places] == sorted(place.start() for place in places)
    assert all(examples for _, examples in ABOUT.values())


@pytest.mark.parametrize("module", MODULES)
def test_a_module_defines_the_commands_that_are_looked_for_in_it(module):
    """A command is loaded alone: what its module does not define would not be found."""
    defined = {command.__module__ for name, command in called() if name in MODULES[module]}
    assert defined == {f"gyronorth.cli.{module}"}


def called():
    """Name and function of each command."""
    for info in app.registered_commands:
        yield info.name or info.callback.__name__, info.callback


@pytest.mark.slow
@pytest.mark.parametrize("name", ABOUT)
def test_examples_use_options_that_the_command_has(name):
    command = COMMANDS[name]
    known = {switch for parameter in command.params for switch in parameter.opts}
    help_text = " ".join(run(name, "--help").stdout.split())
    for example in ABOUT[name][1]:
        program, called, *words = shlex.split(example)
        assert (program, called) == ("gyronorth", name)
        assert {word for word in words if re.match("-{1,2}[a-z]", word)} <= known
        assert words[0] in help_text if words else True


@pytest.mark.parametrize("name", [None, "heading"])
def test_no_word_of_the_help_is_cut_in_a_narrow_terminal(name, monkeypatch):
    monkeypatch.setenv("COLUMNS", "40")
    said = run(*([name] if name else []), "--help").stdout
    assert "…" not in said
    assert "│" not in said
    assert name or said.index("Find north:") < said.index("  explain") < said.index("Know your sensor:")


@pytest.mark.slow
def test_no_type_stands_behind_an_argument():
    for name in ABOUT:
        assert not re.search(r"<(path|str|list)", run(name, "--help").stdout)


def test_the_help_ends_in_examples():
    assert "gyronorth explain rec.npz --sensor sdc500" in run("explain", "--help").stdout


@pytest.mark.parametrize(
    ("arguments", "meant"),
    [
        (("plan", "--sensor", "sdc50", "--latitude", "32"), "sdc500"),
        (("info", __file__, "--gyro-unit", "deg/sec"), "deg/s"),
        (("haeding",), "heading"),
        (("info", __file__.replace("help", "hlep")), "test_help.py"),
    ],
)
def test_a_name_that_is_nearly_right_is_offered(arguments, meant):
    said = run(*arguments)
    assert said.exit_code == 2
    assert f"Did you mean '{meant}'?" in " ".join(said.stderr.split())


@pytest.mark.parametrize(
    ("arguments", "meant"),
    [
        (("examples/data/demo.npz", "--sensor", "sdc500"), "gyronorth heading examples/data/demo.npz --sensor sdc500"),
        (("--sensor", "sdc500", "heading", "a b.csv"), "gyronorth heading --sensor sdc500 'a b.csv'"),
        (("-v", "info", "a.csv"), "gyronorth info -v a.csv"),
        (("help",), "'--help'"),
        (("version",), "'--version'"),
        (("benchmark", "papr", "-o", "out"), "'paper'"),
    ],
)
def test_words_in_another_order_are_put_right(arguments, meant):
    said = run(*arguments)
    assert said.exit_code == 2
    assert meant in said.stderr


@pytest.mark.parametrize("arguments", [(), ("heading",), ("live",)])
def test_a_switch_shows_no_type(arguments):
    assert "<bool>" not in run(*arguments, "--help").stdout


@pytest.mark.parametrize("command", ["explain", "heading", "info", "import"])
@pytest.mark.parametrize("suffix", [".npz", ".csv", ".mat", ".h5", ".bag"])
def test_a_file_that_is_not_there_is_said_to_be_missing(command, suffix):
    said = run(command, f"nowhere{suffix}")
    assert said.exit_code == 2
    assert f"There is no file nowhere{suffix}" in said.stderr


def test_nothing_is_offered_for_a_name_that_is_far_off():
    assert did_you_mean("quaternion", ("sdc500", "stim300")) == ""


def test_tab_offers_what_the_program_accepts(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "st.json").touch()
    (tmp_path / "stop.csv").touch()
    assert completion.sensor("st") == ["stim300", "st.json"]
    for name in completion.sensor(""):
        if not name.endswith(".json"):
            read_sensor(name)
    assert completion.method("") == [info.name for info in METHODS]
    assert [mat_bf(name).shape for name in completion.axes("")] == [(3, 3)] * 24
    for gyro_unit in completion.gyro_unit(""):
        ReadOptions(gyro_unit=gyro_unit)
    assert completion.accel_unit("m") == ["m/s2", "mg", "mm/s2"]
    assert completion.protocol("") == list(NAMES)
    assert "quiet" in completion.disturbance("q")
    assert completion.benchmark("pu") == ["published"]
    assert "table_2" in completion.study("t")


@pytest.mark.parametrize(
    ("command", "option", "typed", "offered"),
    [
        ("heading", "--sensor", "stim3", "stim300"),
        ("heading", "--method", "pos", "posterior"),
        ("heading", "--axes", "rf", "rfu"),
        ("info", "--gyro-unit", "deg/", "deg/s"),
        ("live", "--accel-unit", "m", "mg"),
        ("convert", "--time-unit", "m", "ms"),
        ("heading", "--preset", "eu", "euroc"),
        ("live", "--protocol", "sti", "stim"),
        ("heading", "--imu", "STIM", "STIM300"),
        ("simulate", "--disturbance", "sw", "sway"),
        ("benchmark", "--study", "tab", "table_2"),
        ("allan", "--sensor", "stim3", "stim300"),
        ("allan", "--export", "kal", "kalibr"),
        ("plan", "--method", "in", "inertial"),
        ("heading", "--increments", "b", "both"),
        ("live", "--nmea-set", "oc", "octans"),
        ("live", "--log-level", "w", "warning"),
    ],
)
def test_tab_behind_an_option_offers_its_names(command, option, typed, offered):
    (found,) = (parameter for parameter in COMMANDS[command].params if option in parameter.opts)
    names = [item.value for item in found.shell_complete(Context(COMMANDS[command]), typed)]
    assert offered in names
    assert all(name.startswith(typed) for name in names)


def test_verbose_tells_the_time_of_each_step_and_quiet_nothing():
    words = ("explain", "examples/data/demo.npz", "--sensor", "sdc500")
    loud, quiet = run(*words, "-v"), run(*words, "-q")
    assert re.search(r"^finding north: \d+\.\d{3} s$", loud.stderr, re.MULTILINE)
    assert quiet.stderr == ""
    assert run(*words).stderr == ""  # nothing is kept from the call before
    assert loud.stdout == quiet.stdout


def test_the_help_of_an_option_is_true_of_its_command():
    def said(command, option):
        (found,) = (parameter for parameter in COMMANDS[command].params if option in parameter.opts)
        return found.help

    assert len({said(command, "--plot") for command in ("heading", "allan", "plan")}) == 3
    for command in ("plan", "simulate"):  # no file is read that could state it
        assert "file" not in said(command, "--latitude")
