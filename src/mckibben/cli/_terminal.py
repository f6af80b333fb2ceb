"""Input and output of the commands: shared options, values with units, JSON and tables."""

from __future__ import annotations

import json
import math
import os
import re
import sys
import textwrap
import warnings
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, nullcontext, redirect_stdout
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TextIO

import typer

from ..answers import Caution
from ..documents import JsonValue
from ..errors import InputError, PlausibilityWarning, not_found

if TYPE_CHECKING:
    from ..report.figures import formats


Json = Annotated[bool, typer.Option("--json", help="Print one JSON object, in SI units, and nothing else.")]
Set = Annotated[
    list[str] | None,
    typer.Option(
        "--set", metavar="PATH=VALUE", help="Replace a parameter, such as law.turns=3.2 or thread_length='16 cm'."
    ),
]
CHANGE = "pressure='5 bar', rig.plumbing.direct.tube.length='1 m' or muscle.law.passive_stiffness='3 N/cm'"


def _use_style(context: typer.Context, name: str) -> str:
    """Draw the figures of a command in a style."""
    if name != "screen":  # which needs nothing loaded
        from ..report.figures import formats

        context.with_resource(formats.applied(_named(name, None)))
    return name


def _use_width(context: typer.Context, width: str | None) -> str | None:
    """Draw the figures of a command, in its style, at a width."""
    if width is not None:
        from ..report.figures import formats

        context.with_resource(formats.applied(_named(formats.current_style().name, width)))
    return width


def _named(name: str, width: str | None) -> formats.FigureStyle:
    from ..report.figures import formats

    try:
        return formats.named_style(name, width=width)
    except InputError as error:
        raise error.changed(field=f"--{error.field}") from None


FigureLook = Annotated[
    str,
    typer.Option(
        "--style", metavar="STYLE", is_eager=True, callback=_use_style,
        help="Style of the figure: screen, print (8 pt type, lines that differ without colour), gray or projector.",
    ),
]  # fmt: skip
FigureWidth = Annotated[
    str | None,
    typer.Option(
        "--width", metavar="WIDTH", callback=_use_width,
        help="Width of the figure: column (86 mm), page (178 mm), slide (128 mm), or a length such as '120 mm'.",
    ),
]  # fmt: skip


class _Invocation:
    """What one call of the command line has been asked for, and has said."""

    def __init__(self) -> None:
        self.quiet = False
        self.stdout: Any = None  # where results go while sys.stdout is silenced
        self.expected: list[Caution] = []  # cautions about typed values that are not said yet
        self.warned: list[Caution] = []  # what functions have said as warnings of Python
        self.said: list[Caution] = []
        self.noted: set[str] = set()
        self.paths: dict[str, str] = {}


_call = _Invocation()


def begin() -> None:
    """Forget what was said in an earlier call in the same process."""
    global _call
    _call = _Invocation()


def be_quiet() -> None:
    """Print only errors, and what was asked for by ``--json`` or ``--out -``."""
    _call.quiet = True


def is_quiet() -> bool:
    """Whether ``--quiet`` was given."""
    return _call.quiet


def call_path(path: str, words: str) -> None:
    """Call a path otherwise in messages, as a file that holds standard input."""
    _call.paths[path] = words


def readable(sentence: str) -> str:
    """A message with the words for paths of `call_path`."""
    for path, words in _call.paths.items():
        sentence = sentence.replace(path, words)
    return sentence


def stdout() -> TextIO:
    """Where results go, also while nothing else is printed."""
    return _call.stdout or sys.stdout


@contextmanager
def silence() -> Iterator[None]:
    """Print nothing on standard output but what `print_json` and `_outputs` write."""
    if _call.stdout is not None:
        yield
        return
    _call.stdout = sys.stdout
    with open(os.devnull, "w", encoding="utf-8") as nowhere, redirect_stdout(nowhere):
        try:
            yield
        finally:
            _call.stdout = None


@contextmanager
def silenced() -> Iterator[None]:
    """Print nothing on standard output if ``--quiet`` was given."""
    with silence() if _call.quiet else nullcontext():
        yield


def note(sentence: str) -> None:
    """Print a note on standard error, each once."""
    if not _call.quiet and sentence not in _call.noted:
        _call.noted.add(sentence)
        typer.echo(f"mckibben: note: {sentence}", err=True)


def print_json(value: dict[str, JsonValue]) -> None:
    """Print one JSON object on standard output; a number that is not finite becomes null."""
    out = stdout()
    out.write(json_text(value) + "\n")
    out.flush()


def json_text(value: dict[str, JsonValue]) -> str:
    """One JSON object, with the cautions about unlikely values among its ``warnings``."""
    say_cautions()
    if _call.said:
        own = list(value.get("warnings", []))
        known = {_about(str(one)).parameter for one in own}
        more = {one.parameter or one.text: one.text for one in _call.said if one.parameter not in known}
        value = value | {"warnings": list(dict.fromkeys([*own, *more.values()]))}
    return json.dumps(_clean(value), ensure_ascii=False)


def _clean(value: Any) -> Any:
    if isinstance(value, dict):
        return {str(k): _clean(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [_clean(v) for v in value]
    if hasattr(value, "tolist"):
        return _clean(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def assignments(words: Iterable[str] | None) -> dict[str, str]:
    """Parse ``PATH=VALUE`` arguments to a table; the path may begin with ``muscle.`` or ``law.``."""
    table = pairs(words, "--set", "thread_length='16 cm'")
    changes: dict[str, str] = {}
    for path, value in table.items():
        name = path.removeprefix("muscle.").removeprefix("law.")
        if name in changes:
            raise InputError(f"--set {path}", value, f"must be given once; {name} is {changes[name]} too")
        changes[name] = value
    return changes


def pairs(words: Iterable[str] | None, option: str, example: str) -> dict[str, str]:
    """Parse ``NAME=VALUE`` arguments of an option to a table."""
    table: dict[str, str] = {}
    for word in words or []:
        name, equals, value = (part.strip() for part in word.partition("="))
        if not equals or not name or not value:
            raise InputError(option, word, f"must be NAME=VALUE, such as {example}")
        if name in table:
            raise InputError(f"{option} {name}", value, f"must be given once; it is {table[name]} too")
        table[name] = value
    return table


def writable(option: str, path: Path | None, *endings: str) -> None:
    """Refuse a path that cannot be written, before any work is done."""
    if path is None:
        return
    if path.suffix not in endings:
        raise InputError(option, str(path), f"must be a name that ends in {' or '.join(endings)}")
    if not path.absolute().parent.is_dir():
        raise not_found(path.absolute().parent, "folder")


_OPTIONS = {
    "column": "--column {}=COLUMN",
    "unit": "--unit {}=UNIT",
    "scale": "--scale {}=SCALE",
    "parameter": "--set {}=VALUE",
}

_COMMANDS = {
    "posterior": "`mckibben fit TABLE --posterior --out fit.json`",
    "specimen": "`mckibben fit TABLE --out my-muscle.toml`",
}


def with_command(error: Exception) -> str:
    """The sentence of an error, with the command that makes what is missing."""
    command = _COMMANDS.get(getattr(error, "remedy", ""))
    plain = error.changed(remedy="") if isinstance(error, InputError) and error.remedy else error  # no words of Python
    return str(plain) if command is None else f"{plain}, with {command}"


@contextmanager
def options_named(**more: str) -> Iterator[None]:
    """Add the option of the command line to errors about a missing value.

    Args:
        more: options by the first word of the remedy, beside ``--column``, ``--unit`` and ``--set``.
    """
    try:
        yield
    except InputError as error:
        kind, _, name = error.remedy.partition(" ")
        option = (more | _OPTIONS).get(kind, "").format(name)
        if not option:
            raise error from None
        sentence = f"{error.sentence}, with {option}" if error.sentence else None
        raise error.changed(problem=f"{error.problem}, with {option}", sentence=sentence, remedy="") from None


def expect_cautions(cautions: Iterable[Caution]) -> None:
    """Keep cautions about values as typed until the command has said its own, which know the muscle."""
    _call.expected = [*cautions]


@contextmanager
def cautions_of_python() -> Iterator[None]:
    """Keep what a command's functions say as `PlausibilityWarning`, as cautions of the command."""
    other = warnings.showwarning

    def keep(message: Warning | str, category: type[Warning], *place: Any, **more: Any) -> None:
        if issubclass(category, PlausibilityWarning):
            _call.warned += [_about(str(message))]
        else:
            other(message, category, *place, **more)

    with warnings.catch_warnings():
        warnings.simplefilter("always", PlausibilityWarning)
        warnings.showwarning = keep
        yield


def say_cautions(instead: Iterable[Caution] = ()) -> None:
    """Print what functions have said, and the cautions about typed values of which nothing else speaks."""
    _say(_call.warned)
    spoken = {one.parameter for one in (*instead, *_call.warned)}
    _say(one for one in _call.expected if one.parameter not in spoken)
    _call.expected = []


def caution(*cautions: Caution | str | None) -> list[str]:
    """Print cautions on standard error, one about each value; None is skipped.

    Returns:
        The sentences, for the ``warnings`` of the JSON object.
    """
    shown = [one if isinstance(one, Caution) else _about(one) for one in cautions if one is not None]
    _say(shown)
    say_cautions(shown)
    return [one.text for one in shown]


def _say(cautions: Iterable[Caution]) -> None:
    """Print cautions that were not printed; of a value that was spoken of before the command began, no second one."""
    said = {one.parameter for one in _call.said if one.parameter}
    for one in cautions:
        if one not in _call.said and one.text not in {other.text for other in _call.said}:
            if one.parameter not in said and not _call.quiet:
                typer.echo(f"{program(33)}: caution: {one.text}", err=True)
            _call.said.append(one)


def _about(sentence: str) -> Caution:
    """A sentence as a caution: "a pressure of 500 bar is beyond .." is about the pressure."""
    return Caution(sentence, re.sub("^an? ", "", sentence.partition(" of ")[0]))


def program(colour: int) -> str:
    """The name of the program before a message, in a colour on a terminal unless NO_COLOR is set."""
    coloured = sys.stderr.isatty() and not os.environ.get("NO_COLOR") and os.environ.get("TERM") != "dumb"
    return f"\x1b[{colour}mmckibben\x1b[0m" if coloured else "mckibben"


WIDTH = 160  # of redirected output, which has none of its own: a table must not be cut there
WIDTH_OF_SENTENCES = 120  # below rows, there


def table(
    title: str,
    columns: list[str],
    rows: Iterable[list[str]],
    *,
    right: Iterable[int] = (),
    below: Sequence[str] | None = None,
) -> None:
    """Print a table; `right` are the columns of numbers, `below` what is said below each row."""
    from rich.console import Console
    from rich.table import Table

    console = Console(highlight=False, width=None if sys.stdout.isatty() else WIDTH)
    if title:
        console.print(title, style="bold", soft_wrap=True)
    aligned = set(right)
    if below is not None:  # no table of rich has lines across its columns
        lines = [columns, *rows]
        widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
        wide = max((console.width if sys.stdout.isatty() else WIDTH_OF_SENTENCES) - 4, 40)
        for line, sentence in zip(lines, ("", *below), strict=True):
            cells = (
                c.rjust(w) if i in aligned else c.ljust(w) for i, (c, w) in enumerate(zip(line, widths, strict=True))
            )
            typer.echo("  ".join(cells).rstrip())
            for part in textwrap.wrap(sentence, wide):
                typer.echo(f"    {part}")
        return
    out = Table(box=None, pad_edge=False, header_style="dim", show_header=any(columns))
    for i, column in enumerate(columns):
        out.add_column(column, justify="right" if i in aligned else "left", no_wrap=i in aligned)
    for row in rows:
        out.add_row(*row)
    console.print(out)


def ask_person(task: str) -> None:
    """Wait until the operator has done something."""
    if not sys.stdin.isatty():
        raise InputError("person", None, f"is needed at the keyboard: the protocol asks the operator to {task}")
    typer.prompt(f"Please {task}, then press Enter", default="", show_default=False, err=True)
