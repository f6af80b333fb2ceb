"""Table of all commands, and conversion of errors to one line and an exit code."""

from __future__ import annotations

import contextlib
import functools
import importlib
import itertools
import os
import shutil
import sys
import warnings
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any

import typer
import typer.core
import typer.main

from lanewise.cache import is_private, make_private_folder
from lanewise.errors import CacheWarning

from .._version import __version__
from ..errors import ConvergenceError, MckibbenError, StageError
from ..isolation import start_for
from ..registry import CODE, FIXED, PACKAGES, announced
from ._command import CommandWithHelp, help_width, rows_of_help, with_plain_values
from ._progress import INTERRUPTED, ended, guarded, sentence
from ._terminal import begin, program, readable, with_command

ROOM = 16 << 20  # that a disk must have for compilations to be kept [B]; JAX leaves parts of files on a full one
# Warnings of JAX on a disk that is full, or was full once: it compiles again.
CACHE = ("Error writing persistent compilation cache", "Error reading persistent compilation cache")


# Each command by its words, and the line of help that lists it.
LINES = {
    "muscles": "List the muscles that ship, with their sources.",
    "show": "Show the parameters of a muscle with their units and sources, and its law.",
    "tension": "Compute tension, volume and state of a muscle at one length and pressure.",
    "braid": "Describe a muscle from the dimensions of its braid and bladder, with ranges for what is not known.",
    "read": "Read a file of another program and show its columns, units, and the rows left out.",
    "fit": "Fit tension laws to a measured table of length, pressure and tension, and rank them.",
    "next": "Choose the points of length and pressure that teach most next, and write them as a protocol.",
    "check": "Check a tension law or friction of your own: energy, push, potential, derivatives, units, kernel.",
    "protocols": "List the protocols, or describe one of them with all its numbers.",
    "run": "Run a protocol on a test machine; nothing moves until the dry run passes.",
    "joint": "Run two muscles on a joint, by valve commands over time or by set-points of angle and stiffness.",
    "console": "Operate a test machine, simulated or real, at a prompt, by a script or a pipe.",
    "device": "Check a test machine before its first run, replay such a check, or serve a simulated machine.",
    "device check": (
        "Check that each sensor answers valve and motor: sign, scale, noise, range, delay; and that the machine vents."
    ),
    "device replay": "Run check, calibration and first protocol on a machine that is not here, from the file of its check.",
    "device serve": "Serve a simulated test machine on a virtual serial port.",
    "characterise": (
        "Characterise an unknown muscle on a test machine: map, friction, relaxation, leak, and a fitted specimen."
    ),
    "energy": "Compute input, output and efficiency of a muscle's working cycles.",
    "compare": "Compare muscles with each other, and with published biological muscle.",
    "reproduce": "Compute the papers' numbers and report whether each value is reproduced.",
    "diagnose": "Find a fault of a rig from a recording of its normal operation.",
    "benchmark": "Train models on measured tasks, and score their predictions of what they were not shown.",
    "parts": "List valves, tubes, gas sources, laws and muscles with numbers, units and sources.",
    "size": "Find the muscle, valve, tube and gas source for a force and a stroke.",
    "control": "Score controllers on a bench: median and worst on plants that they were not built on.",
    "sweep": "Run a protocol on many variants of a rig and a muscle; resumable, results in zarr.",
    "export": "Export a muscle with its air as a part of another program: spans in, tensions out.",
    "conform": "Test a host of muscles: errors, order, work at the border, saved states, smallest mass and speed.",
    "serve": "Serve the web interface to a browser on this machine.",
    "circuit": "Show, run, linearise and fit pneumatic circuits.",
    "circuit show": "Describe a circuit, its fastest mode, and the method with which a run begins.",
    "circuit run": "Run a circuit, close its balances of mass and energy, and save the recording.",
    "circuit frequency": "Compute the frequency response of a circuit that is linearised at rest.",
    "circuit fit": "Fit a circuit's parameters to records of its pressures, and predict other records.",
    "record": "Show, plot, report on, analyse, convert and repair recordings.",
    "record show": "Describe a recording: protocol, muscle, rig, steps, channels, balances, events.",
    "record list": "List the recordings of a folder by what differs between them.",
    "record plot": "Draw a recording over time, or one channel over another; of several recordings or a sweep their loops.",
    "record convert": "Convert a recording, or a file of another program, to another file format.",
    "record energy": "Account for the exergy of a recording: supply, losses and shaft work.",
    "record loops": "Measure each loop of tension over length: work, friction, width, height and stiffness.",
    "record work": (
        "Compute the work and power of a muscle in each cycle, or along the whole record where there is no cycle."
    ),
    "record stiffness": "Measure the stiffness about the middle of each loop, or of one pull where there is no loop.",
    "record steps": (
        "Time how pressure and tension follow each step of a command, or a muscle its stimulus: "
        "delay, rise and settling."
    ),
    "record leak": "Measure how fast the pressure of a shut muscle falls, and how much air that is.",
    "record frequency": "Estimate the frequency response between two channels.",
    "record contraction": "Time a twitch or tetanus: stimulus, peak, and set points of rise and relaxation.",
    "record work-loops": "Compute work and power of each cycle of a muscle on a lever.",
    "record repair": "Recover a recording from the log of a killed process.",
    "record repeatability": "Report how well cycles or runs repeat each other.",
    "record report": "Write a report of a recording: figures, balances, parameters, references.",
    "calibrate": "Calibrate the channels of a rig, show a calibration, or apply it to a recording.",
    "calibrate zero": "Calibrate the zeros of channels without load and pressure.",
    "calibrate weights": "Calibrate a load cell with dead weights, up and down.",
    "calibrate pressure": "Calibrate pressure sensors with a reference gauge, whose points are set now or were read before.",
    "calibrate encoder": "Calibrate the encoder with known travels, such as those of gauge blocks.",
    "calibrate skew": "Calibrate the lag of channels behind the first one, from a common signal.",
    "calibrate show": "Show a calibration: values, 95 % intervals, origin and age.",
    "calibrate apply": "Apply a calibration to a recording in place of the one it carries.",
    "study": "Run the studies of tubes, a robot, loops and all laws.",
    "study tube": "Compare lumped models of a tube with the distributed one, claim by claim.",
    "study robot": "Fit the air of a jumping robot to some of its jumps, and predict the others.",
    "study loops": "Predict half of a muscle's loop and creep from the other half.",
    "study validation": "Fit every tension law to every data set, and cross-validate it.",
    "completion": "Print the script with which a shell completes commands, options and values.",
    "help": "Show the help of a command.",
}
# The module and function that run a command which is no verb of `verb_commands` by its own name. The module is imported when
# the command is called, for most of them load what computes, which takes a second. A group has no function. A name of
# `registry.PACKAGES` stands for a package that announces the command: asking it for its lines would make every help slow.
PLACES = {
    "next": "verb_commands:next_measurement",
    "check": "check:check_law",
    "console": "console:console",
    "serve": "serve:serve_screen",
    "record list": "record:list_recordings",
    "record plot": "record:plot",
    "record convert": "record:convert_file",
    "record repair": "record:repair",
    "record report": "record:report",
    "completion": "completion:completion",
    "help": "completion:show_help",
}
for place, several in (
    ("", "device, circuit, record, calibrate, study"),
    ("hardware", "device check, device replay, device serve, calibrate zero, calibrate weights, calibrate pressure"),
    ("hardware", "calibrate encoder, calibrate skew"),
    ("papers", "reproduce"),
    ("benchmark", "benchmark, study robot, study loops, study validation"),
    ("hosts", "export, conform"),
):
    PLACES |= dict.fromkeys(several.split(", "), place)
COMMANDS = {
    words: (PLACES.get(words, f"verb_commands:{words.replace(' ', '_').replace('-', '_')}"), line)
    for words, line in LINES.items()
}


NAMES = {"help_option_names": ["-h", "--help"]}


class CommandTable(Mapping[str, Any]):
    """Commands of `COMMANDS` one level below a group, imported on demand.

    Args:
        group: name of the group, empty for the program itself.
    """

    def __init__(self, group: str = "") -> None:
        self.group = group

    def __getitem__(self, name: str) -> Any:
        words = f"{self.group} {name}".strip()
        if name not in set(self):
            raise KeyError(name)
        place, summary = COMMANDS[words]
        if not place:
            return CommandGroup(
                name=name,
                group=words,
                help=summary,
                no_args_is_help=True,
                rich_markup_mode=None,
                context_settings=NAMES,
            )
        if place in PACKAGES:
            run = announced("mckibben.commands", words.replace(" ", "-"), place, f"mckibben {words} needs")
        else:
            module, _, function = place.partition(":")
            run = getattr(importlib.import_module(f".{module}", __package__), function)
        single = typer.Typer(add_completion=False, rich_markup_mode=None)
        kind = type("CommandWithHelp", (CommandWithHelp,), {"words": words})
        run = run.function() if hasattr(run, "function") else run  # of a verb
        single.command(name, cls=kind, context_settings=NAMES)(run)
        return typer.main.get_command(single)

    def __iter__(self) -> Iterator[str]:
        return (name for *group, name in map(str.split, COMMANDS) if group == self.group.split())

    def __len__(self) -> int:
        return sum(1 for _ in self)

    def summaries(self) -> list[tuple[str, str]]:
        """Names with their lines of help."""
        return [(name, COMMANDS[f"{self.group} {name}".strip()][1]) for name in self]


class CommandGroup(typer.core.TyperGroup):
    """A group whose commands are those of a `CommandTable`."""

    def __init__(self, *, group: str = "", **options: Any) -> None:
        super().__init__(**options)
        self.commands: Any = CommandTable(group)

    def get_params(self, ctx: Any) -> list[Any]:
        """Parameters and the option of the help."""
        return with_plain_values(super().get_params(ctx))

    def make_context(self, *args: Any, **options: Any) -> Any:
        """Parse the words of the command line; Ctrl-C is reported by `main`."""
        try:
            return super().make_context(*args, **options)
        except KeyboardInterrupt:
            raise typer.Abort from None

    def invoke(self, ctx: Any) -> Any:
        """Run the command; Ctrl-C is reported by `main`, while typer would end without a word."""
        try:
            return super().invoke(ctx)
        except KeyboardInterrupt:
            raise typer.Abort from None

    def list_commands(self, ctx: Any) -> list[str]:
        """Names in the order of the table."""
        return list(self.commands)

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Write the help, with a list of the commands; none of them is imported."""
        width = help_width()
        options = [(", ".join(p.opts), getattr(p, "help", "") or "") for p in self.params] + [
            ("-h, --help", "Show this help and exit.")
        ]
        formatter.write(
            f"Usage: {ctx.command_path} COMMAND ..\n\n  {self.help}\n\n"
            f"Commands:\n{rows_of_help(self.commands.summaries(), width)}\n\n"
            f"Options:\n{rows_of_help(options, width)}\n\n"
            f"{ctx.command_path.split()[0]} help COMMAND shows what a command takes.\n"
        )


app = typer.Typer(
    name="mckibben",
    cls=CommandGroup,
    help="Models, test bench and analysis for McKibben pneumatic artificial muscles.",
    context_settings=NAMES,
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)


def _version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"mckibben {__version__}")
        raise typer.Exit


@app.callback()
def options(
    version: Annotated[
        bool, typer.Option("--version", help="Print the version and exit.", callback=_version, is_eager=True)
    ] = False,
) -> None:
    """Models, test bench and analysis for McKibben pneumatic artificial muscles."""


def main(arguments: list[str] | None = None) -> None:
    """Run the command line; never shows a traceback for a wrong input.

    Args:
        arguments: words after the program's name; those of the process by default.
    """
    with warnings.catch_warnings(), _safe_children(), guarded():
        warnings.showwarning = _show_warning
        for words in CACHE:
            warnings.filterwarnings("ignore", words, UserWarning)
        code = _execute(arguments)
    sys.exit(code if isinstance(code, int) else 0)


@functools.cache
def table_of_commands() -> Any:
    """Build the table of all commands, which takes typer 40 ms."""
    return typer.main.get_command(app)


@contextlib.contextmanager
def _safe_children() -> Iterator[None]:
    """Keep child processes from importing modules of the current folder, which may contain data of a user.

    Python files that the command allows are allowed until it ends.
    """
    known = {name: os.environ.get(name) for name in ("PYTHONSAFEPATH", "PYTHONWARNINGS", CODE, FIXED)}
    os.environ["PYTHONSAFEPATH"] = "1"
    os.environ["PYTHONWARNINGS"] = ",".join([*filter(None, [known["PYTHONWARNINGS"]]), *(f"ignore:{w}" for w in CACHE)])
    try:
        yield
    finally:
        for name, value in known.items():
            os.environ.pop(name, None)
            if value is not None:
                os.environ[name] = value


def _execute(arguments: list[str] | None) -> Any:
    """Run a command and return its exit code."""
    words = sys.argv[1:] if arguments is None else arguments
    files = (word for before, word in itertools.pairwise(("", *words)) if before != "--out")
    start_for(files, "mckibben.formats.registry")
    _keep_compilations()
    begin()
    try:
        code = table_of_commands().main(args=arguments, prog_name="mckibben", standalone_mode=False)
    except (typer.Abort, KeyboardInterrupt):
        ended()
        code = _complain(sentence(), INTERRUPTED)
    except (ConvergenceError, StageError) as error:
        code = _complain(str(error), 1)
    except MckibbenError as error:
        code = _complain(with_command(error), 2)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        code = 0
    except OSError as error:
        code = _complain(f"{error.filename or 'file'}: {error.strerror}", 2)
    except Exception as error:
        # The parser's own complaints; which module defines their class depends on typer's version.
        if not hasattr(error, "format_message"):
            raise
        if type(error).__name__ == "NoArgsIsHelpError":
            typer.echo(error.format_message())
            return 0
        code = _complain(" ".join(f"{error.format_message()}{_meant(error)}".split()), 2)
    return code


def _show_warning(message: Warning | str, category: type[Warning], *where: Any, **more: Any) -> None:
    """Print a warning for the user as one line; all others as Python does."""
    if issubclass(category, CacheWarning):
        _complain(str(message), 0)
    else:
        sys.stderr.write(warnings.formatwarning(message, category, *where[:2]))


def _keep_compilations() -> None:
    """Let commands reuse earlier compilations; ``JAX_COMPILATION_CACHE_DIR`` sets another folder, or none.

    They are machine code: a folder that others can change is not used.
    """
    if "jax" in sys.modules or "JAX_COMPILATION_CACHE_DIR" in os.environ:
        return
    home = os.environ.get("LOCALAPPDATA") or os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    folder = Path(home, "mckibben", "compiled")
    if not folder.is_absolute():
        return
    if not is_private(folder):
        warnings.warn(CacheWarning(folder, "JAX_COMPILATION_CACHE_DIR"), stacklevel=2)
        return
    with contextlib.suppress(OSError):  # a home that cannot be written, or is full, keeps nothing
        make_private_folder(folder)
        if shutil.disk_usage(folder).free < ROOM:
            return
        os.environ["JAX_COMPILATION_CACHE_DIR"] = str(folder)
        os.environ.setdefault("JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS", "0.02")


def _meant(error: Any) -> str:
    """The option that was meant by ``-o``, or by a name of a muscle without its option, as the end of a complaint."""
    command = getattr(getattr(error, "ctx", None), "command", None)
    options = [name for p in getattr(command, "params", ()) for name in p.opts if name.startswith("--")]
    short = str(getattr(error, "option_name", ""))
    if len(short) == 2 and short[0] == "-":
        near = [name for name in options if name.startswith(f"-{short}")]
        return f". Did you mean {' or '.join(near)}?" if near else ""
    if "unexpected extra argument" in error.format_message() and "--muscle" in options:
        return ". A muscle is given as --muscle"
    return ""


def _complain(sentence: str, code: int) -> int:
    plain = "".join(
        c if c.isprintable() else c.encode("unicode_escape").decode() for c in " ".join(readable(sentence).split())
    )
    typer.echo(f"{program(31 if code else 33)}: {plain}", err=True)
    return code
