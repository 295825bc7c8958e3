"""The application that the commands join: exit codes, and one message for what the user got wrong."""

from __future__ import annotations

import importlib
import io
import os
import re
import shlex
import shutil
import sys
import traceback
from collections.abc import Sequence
from contextlib import suppress
from difflib import get_close_matches
from typing import Any, NoReturn

import typer
from typer.core import TyperGroup

from gyronorth.cli import progress
from gyronorth.cli.conversion import convert_directly
from gyronorth.cli.progress import NORMAL, QUIET, VERBOSE
from gyronorth.cli.tasks import ABOUT, MODULES

#: Panel of the options that every command has.
PANEL = "Verbosity"
#: Characters in a line below which the help of a command has no frames: their columns would cut words.
NARROW = 64
#: Exit code where whoever read standard output has gone before all was written: what a shell gives for SIGPIPE. It says
#: nothing of a heading.
READER_GONE = 141


class _ReaderGone(Exception):
    """Whoever read standard output has gone."""


class _Said(io.FileIO):
    """Standard error: what cannot be written there is lost, and neither ends a command nor changes its exit code."""

    def write(self, data: Any, /) -> int:
        try:
            return super().write(data) or 0
        except OSError:
            return len(data)


class Commands(TyperGroup):
    """Shows the commands by task, runs one, and turns what it returns into the exit code, an error into one message.

    A command is loaded when it is called: each has its module, and building the options of all takes longer than many
    a recording.
    """

    def __init__(self, **attributes: Any) -> None:
        super().__init__(**attributes)
        verbosity = _verbosity()
        for name, command in self.commands.items():
            task, examples = ABOUT.get(name, (None, ()))
            shown: Any = command
            shown.rich_help_panel = task
            if examples:  # an empty line between them keeps each on its own line
                shown.epilog = "\n\n".join(["Examples:", *examples])
            shown.params += verbosity

    def get_params(self, ctx: Any) -> list[Any]:
        """The options of the program itself."""
        return _prepared(super().get_params(ctx))

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """The command of a name, loaded; for a name that there is not, all are, to offer what is near."""
        if cmd_name not in self.commands:
            self._load([module for module, names in MODULES.items() if cmd_name in names] or list(MODULES))
        command: Any = super().get_command(ctx, cmd_name)
        if command is not None:
            _prepared(command.get_params(ctx))
            command.rich_markup_mode = None if narrow() else self.rich_markup_mode
        return command

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """The help of the program, in a narrow terminal without frames."""
        mode = self.rich_markup_mode
        self.rich_markup_mode = None if narrow() else mode
        try:
            super().format_help(ctx, formatter)
        finally:
            self.rich_markup_mode = mode

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """The commands by task, in a help without frames."""
        known = {name: self.get_command(ctx, name) for name in self.list_commands(ctx)}
        for task in dict.fromkeys(task for task, _ in ABOUT.values()):
            named = [name for name in known if name in ABOUT and ABOUT[name][0] == task]
            with formatter.section(task):
                formatter.write_dl([(name, known[name].get_short_help_str(limit=200)) for name in named])

    def _load(self, modules: Sequence[str] = tuple(MODULES)) -> None:
        """Let modules define their commands, and take these up."""
        for module in modules:
            importlib.import_module(f"gyronorth.cli.{module}")
        known: Any = typer.main.get_command(app)
        self.commands.update(known.commands)

    def list_commands(self, ctx: Any) -> list[str]:
        """The names in the order of the tasks; what no task names comes last."""
        self._load()
        return sorted(super().list_commands(ctx), key=[*ABOUT, *self.commands].index)

    def invoke(self, ctx: Any) -> Any:
        """The command itself: typer would end without a word where it is interrupted, or its reader has gone."""
        try:
            return super().invoke(ctx)
        except KeyboardInterrupt:
            raise typer.Abort from None
        except BrokenPipeError:
            raise _ReaderGone from None

    def main(self, *args: Any, standalone_mode: bool = True, **extra: Any) -> Any:
        """Run the command that the arguments name, and end the process with its exit code."""
        if not standalone_mode:
            return super().main(*args, standalone_mode=False, **extra)
        from gyronorth.files import unwound_by_signals

        with unwound_by_signals():
            self._run(args, extra)

    def _run(self, args: Sequence[Any], extra: dict[str, Any]) -> NoReturn:
        """The command, and the exit code of what came of it."""
        progress.level = NORMAL
        for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
            if getattr(sys, name) is None:  # closed: no file of ours is to take its number
                setattr(sys, name, open(os.devnull, mode))  # noqa: SIM115  # for as long as the command runs
        if isinstance(sys.stdout, io.TextIOWrapper):
            sys.stdout.reconfigure(errors="backslashreplace")  # a file name may not fit the terminal's encoding
        if isinstance(sys.stderr, io.TextIOWrapper):
            with suppress(OSError):  # in a test it is no file
                said = io.BufferedWriter(_Said(sys.stderr.fileno(), "w", closefd=False))
                sys.stderr = io.TextIOWrapper(said, sys.stderr.encoding, "backslashreplace", line_buffering=True)
        words = args[0] if args else extra.pop("args", None)
        given = with_bare_increments(list(sys.argv[1:] if words is None else words))
        try:
            code = super().main(given, *args[1:], standalone_mode=False, **extra)
            sys.stdout.flush()
        except (_ReaderGone, BrokenPipeError):
            sys.stdout = None  # type: ignore[assignment]  # nothing is left to flush
            sys.exit(READER_GONE)
        except SystemExit as end:  # rich gives a code of its own where its reader has gone
            sys.exit(READER_GONE if end.code == 1 else end.code)
        except (KeyboardInterrupt, typer.Abort):
            _fail("interrupted", 130)
        except Exception as error:
            message = _user_error(error, given)
            if message is None or progress.level == VERBOSE:
                raise
            traceback.clear_frames(error.__traceback__)  # where memory is short, what they hold
            _fail(message, 2)
        sys.exit(code if isinstance(code, int) else 0)


def narrow() -> bool:
    """Whether the terminal is too narrow for frames."""
    return shutil.get_terminal_size().columns < NARROW


def _prepared(parameters: list[Any]) -> list[Any]:
    """The parameters, converted directly and without the types that some versions of typer write in the help."""
    for parameter in parameters:
        convert_directly(parameter)
        if getattr(parameter, "is_flag", False):
            parameter.metavar = ""
        elif parameter.param_type_name == "argument":
            parameter.display_type = lambda _: ""
    return parameters


def _what_was_meant(message: str, arguments: list[str]) -> str:
    """What else the words can mean where they name no command: a file, an option, a command that stands further on."""
    first = arguments[0] if arguments else ""
    if message.startswith("No such option"):
        if file := next((word for word in arguments if word.startswith("-") and os.path.exists(word)), None):
            return f" If the file of that name is meant: ./{file}"
        at = next((i for i, word in enumerate(arguments) if word in ABOUT), 0)
        moved = shlex.join(["gyronorth", arguments[at], *arguments[:at], *arguments[at + 1 :]])
        return f" Options follow the command. Did you mean: {moved}" if at else ""
    if not message.startswith("No such command") or "Did you mean" in message:
        return ""
    if first in ("help", "version"):
        return f" Did you mean '--{first}'?"
    if os.path.exists(first):
        return f" Did you mean: {shlex.join(['gyronorth', 'heading', *arguments])}"
    near = get_close_matches(first, ABOUT, n=1)
    return f" Did you mean '{near[0]}'?" if near else ""


def with_bare_increments(arguments: list[str]) -> list[str]:
    """The arguments with `--increments` alone meaning those of both sensors."""
    behind = [*arguments[1:], ""][: len(arguments)]
    return [
        "--increments=both" if word == "--increments" and after not in ("gyro", "accel", "both", "none") else word
        for word, after in zip(arguments, behind, strict=True)
    ]


def _user_error(error: Exception, arguments: list[str]) -> str | None:
    """The message of an error the user can cure, None for a fault of ours."""
    from gyronorth.errors import InputError, is_of_memory

    if hasattr(error, "format_message"):  # usage errors of click, wherever this version of typer keeps them
        context = getattr(error, "ctx", None)
        hint = f"\nTry '{context.command_path} --help'." if context else ""
        # Some versions let a word of pydantic's through.
        message = error.format_message().replace("Value error, ", "").replace("\n\t", " ")  # type: ignore[attr-defined]
        return message + _what_was_meant(message, arguments) + hint
    if isinstance(error, InputError):
        # A reader's question ends in the command that would settle it.
        return error.for_command(arguments) if hasattr(error, "for_command") else str(error)  # type: ignore[attr-defined]
    if isinstance(error, OSError):
        return f"{error.filename or 'output'}: {error.strerror or error}."
    if isinstance(error, ImportError) and re.search("map segment|allocate memory", str(error)):
        return f"There is not enough memory to load a library: {error}."
    if is_of_memory(error):
        said = f": {error}" if str(error) else ""
        return f"There is not enough memory{said}. Take a shorter duration or a lower rate, or allow it more memory."
    return None


def _fail(message: str, code: int) -> NoReturn:
    from gyronorth.errors import printable

    typer.echo(f"error: {printable(message)}", err=True)
    sys.exit(code)


def _set_level(level: int) -> Any:
    """A callback of a flag: how much is said."""

    def chosen(given: bool) -> None:
        if given:
            progress.level = level

    return chosen


def _verbosity() -> list[Any]:
    """The options -q and -v, as this version of typer makes them."""
    apart = typer.Typer(add_completion=False)

    @apart.command()
    def _sample(
        quiet: bool = typer.Option(
            False,
            "-q",
            "--quiet",
            callback=_set_level(QUIET),
            expose_value=False,
            rich_help_panel=PANEL,
            help="Results and errors only: no progress on standard error.",
        ),
        verbose: bool = typer.Option(
            False,
            "-v",
            "--verbose",
            callback=_set_level(VERBOSE),
            expose_value=False,
            rich_help_panel=PANEL,
            help="Time of each step and traceback of errors on standard error.",
        ),
    ) -> None: ...

    return typer.main.get_command(apart).params


app = typer.Typer(
    cls=Commands,
    help="True north from a gyroscope that stands still, with an uncertainty that can be believed.",
    invoke_without_command=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _version(show: bool) -> None:
    if show:
        from importlib.metadata import version

        typer.echo(f"gyronorth {version('gyronorth')}")
        raise typer.Exit()


@app.callback()
def _global_options(
    context: typer.Context,
    version: bool = typer.Option(  # noqa: ARG001 - its callback acts
        False, "--version", callback=_version, is_eager=True, help="Show the version."
    ),
) -> None:
    """True north from a gyroscope that stands still, with an uncertainty that can be believed."""
    if context.invoked_subcommand is None:
        typer.echo(context.get_help())


def commands() -> dict[str, Any]:
    """All commands by name, loaded."""
    group: Any = typer.main.get_command(app)
    group.list_commands(None)
    return group.commands
