"""Input and output of the commands: shared options, values with units, JSON and tables."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..errors import InputError, not_found
from ..report.figures import formats

if TYPE_CHECKING:
    from ..specimens import Specimen


Json = Annotated[bool, typer.Option("--json", help="Print one JSON object, in SI units, and nothing else.")]
Set = Annotated[
    list[str] | None,
    typer.Option(
        "--set", metavar="PATH=VALUE", help="Replace a parameter, such as law.turns=3.2 or thread_length='16 cm'."
    ),
]
Plumbing = Annotated[str | None, typer.Option(help="Name of the plumbing that joins the rig's pneumatic parts.")]
NoiseSeed = Annotated[int, typer.Option(min=0, help="Random seed for sensor noise; equal seeds give equal recordings.")]
LockStep = Annotated[
    bool,
    typer.Option(
        "--lock-step", help="Let a simulated device wait for every command instead of following its own clock."
    ),
]


def _use_style(context: typer.Context, name: str) -> str:
    """Draw the figures of a command in a style."""
    context.with_resource(formats.applied(_named(name, None)))
    return name


def _use_width(context: typer.Context, width: str | None) -> str | None:
    """Draw the figures of a command, in its style, at a width."""
    if width is not None:
        context.with_resource(formats.applied(_named(formats.current_style().name, width)))
    return width


def _named(name: str, width: str | None) -> formats.FigureStyle:
    try:
        return formats.named_style(name, width=width)
    except InputError as error:
        raise error.changed(field=f"--{error.field}") from None


PICTURES = formats.SUFFIXES  # endings of the files of figures
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


def print_json(value: dict[str, Any]) -> None:
    """Print one JSON object on standard output; a number that is not finite becomes null."""
    typer.echo(json.dumps(_clean(value), ensure_ascii=False))


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
    return {path.removeprefix("muscle.").removeprefix("law."): value for path, value in table.items()}


def pairs(words: Iterable[str] | None, option: str, example: str) -> dict[str, str]:
    """Parse ``NAME=VALUE`` arguments of an option to a table."""
    table = {}
    for word in words or []:
        name, equals, value = word.partition("=")
        if not equals or not name.strip() or not value.strip():
            raise InputError(option, word, f"must be NAME=VALUE, such as {example}")
        table[name.strip()] = value.strip()
    return table


def writable(option: str, path: Path | None, *endings: str) -> None:
    """Refuse a path that cannot be written, before any work is done."""
    if path is None:
        return
    if path.suffix not in endings:
        raise InputError(option, str(path), f"must be a name that ends in {' or '.join(endings)}")
    if not path.absolute().parent.is_dir():
        raise not_found(path.absolute().parent, "folder")


def chosen_law(law: str | None, spec: Specimen) -> str:
    """Name of the requested law, or of the specimen's own."""
    if law is not None and not law.strip():
        raise InputError("--law", law, f"{spec.id} states", known=spec.laws)
    return spec.law if law is None else law


_OPTIONS = {"column": "--column {}=COLUMN", "unit": "--unit {}=UNIT", "parameter": "--set {}=VALUE"}


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


def caution(*sentences: str | None) -> list[str]:
    """Print cautions on standard error; None is skipped.

    Returns:
        The sentences, for the ``warnings`` of the JSON object.
    """
    shown = [sentence for sentence in sentences if sentence is not None]
    for sentence in shown:
        typer.echo(f"mckibben: caution: {sentence}", err=True)
    return shown


def table(title: str, columns: list[str], rows: Iterable[list[str]], *, right: Iterable[int] = ()) -> None:
    """Print a table; `right` are the columns of numbers."""
    from rich.console import Console
    from rich.table import Table

    # Redirected output has no width of its own: a table must not be cut there.
    console = Console(highlight=False, width=None if sys.stdout.isatty() else 160)
    if title:
        console.print(title, style="bold", soft_wrap=True)
    out = Table(box=None, pad_edge=False, header_style="dim", show_header=any(columns))
    aligned = set(right)
    for i, column in enumerate(columns):
        out.add_column(column, justify="right" if i in aligned else "left", no_wrap=i in aligned)
    for row in rows:
        out.add_row(*row)
    console.print(out)


@contextmanager
def progress(what: str, total: int) -> Iterator[Any]:
    """Show a progress bar with remaining time on standard error, on a terminal only; yields ``advance(words, by=1)``."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    console = Console(stderr=True)
    bar = Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        TimeRemainingColumn(),
        console=console,
        transient=True,
        disable=not console.is_terminal,
    )
    with bar:
        task = bar.add_task(what, total=total)

        def advance(words: str, by: int = 1) -> None:
            bar.update(task, advance=by, description=words)

        yield advance


@contextmanager
def told(what: str) -> Iterator[Any]:
    """Show a changing line on standard error, for work of unknown length; yields ``tell(words)``; only on a terminal."""
    from rich.console import Console

    console = Console(stderr=True)
    if not console.is_terminal:
        yield lambda words: None
        return
    with console.status(what) as status:
        yield lambda words: status.update(f"{what}: {words}")
