"""The commands' table, and the one place where an error becomes a line and an exit code."""

from __future__ import annotations

import contextlib
import functools
import os
import shutil
import sys
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any

import typer

from lanewise.cache import is_private, make_private_folder
from lanewise.errors import CacheWarning

from .. import __version__
from ..errors import ConvergenceError, MckibbenError
from . import (
    calibrate,
    circuit_fit,
    compare,
    console,
    device,
    energy,
    fit,
    muscles,
    protocols,
    record,
    reproduce,
    run,
    serve,
    size,
    study,
    sweep,
)

ROOM = 16 << 20  # that a disk must have for compilations to be kept [B]; JAX leaves parts of files on a full one
# Warnings of JAX on a disk that is full, or was full once: it compiles anew.
CACHE = ("Error writing persistent compilation cache", "Error reading persistent compilation cache")

app = typer.Typer(
    name="mckibben",
    help="A laboratory for McKibben pneumatic artificial muscles.",
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
        bool, typer.Option("--version", help="Print the version.", callback=_version, is_eager=True)
    ] = False,
) -> None:
    """A laboratory for McKibben pneumatic artificial muscles."""


muscles.add_to(app)
fit.add_to(app)
circuit_fit.add_to(app)
protocols.add_to(app)
record.add_to(app)
run.add_to(app)
console.add_to(app)
device.add_to(app)
calibrate.add_to(app)
energy.add_to(app)
compare.add_to(app)
reproduce.add_to(app)
size.add_to(app)
study.add_to(app)
sweep.add_to(app)
serve.add_to(app)


def main(arguments: list[str] | None = None) -> None:
    """Run the command line; never shows a traceback for a wrong input.

    Args:
        arguments: words after the program's name; those of the process where left out.
    """
    command = _command()
    with warnings.catch_warnings(), _safe_children():
        warnings.showwarning = _show_warning
        for words in CACHE:
            warnings.filterwarnings("ignore", words, UserWarning)
        code = _execute(command, arguments)
    sys.exit(code if isinstance(code, int) else 0)


@functools.cache
def _command() -> Any:
    """The table of all commands, which takes typer 40 ms."""
    return typer.main.get_command(app)


@contextlib.contextmanager
def _safe_children() -> Iterator[None]:
    """Processes that a command starts take no module from the folder in which it stands, where somebody's data may lie."""
    known = {name: os.environ.get(name) for name in ("PYTHONSAFEPATH", "PYTHONWARNINGS")}
    os.environ["PYTHONSAFEPATH"] = "1"
    os.environ["PYTHONWARNINGS"] = ",".join([*filter(None, [known["PYTHONWARNINGS"]]), *(f"ignore:{w}" for w in CACHE)])
    try:
        yield
    finally:
        for name, value in known.items():
            os.environ.pop(name)
            if value is not None:
                os.environ[name] = value


def _execute(command: Any, arguments: list[str] | None) -> Any:
    """The exit code of a command, whatever happens in it."""
    _keep_compilations()
    try:
        code = command.main(args=arguments, prog_name="mckibben", standalone_mode=False)
    except (typer.Abort, KeyboardInterrupt):
        code = _complain("interrupted; nothing was written", 130)
    except ConvergenceError as error:
        code = _complain(str(error), 1)
    except MckibbenError as error:
        code = _complain(str(error), 2)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        code = 0
    except OSError as error:
        code = _complain(f"{error.filename or 'file'}: {error.strerror}", 2)
    except Exception as error:
        # The parser's own complaints; which module defines their class depends on typer's version.
        if not hasattr(error, "format_message"):
            raise
        code = _usage(error)
    return code


def _show_warning(message: Warning | str, category: type[Warning], *where: Any, **more: Any) -> None:
    """A warning that is meant for a person as one line; all others as Python shows them."""
    if issubclass(category, CacheWarning):
        _complain(str(message), 0)
    else:
        sys.stderr.write(warnings.formatwarning(message, category, *where[:2]))


def _keep_compilations() -> None:
    """Let a command find what an earlier one compiled; ``JAX_COMPILATION_CACHE_DIR`` says another place, or none.

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


def _usage(error: Any) -> int:
    if type(error).__name__ == "NoArgsIsHelpError":
        typer.echo(error.format_message())
        return 0
    return _complain(" ".join(error.format_message().split()), 2)


def _complain(sentence: str, code: int) -> int:
    plain = "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in " ".join(sentence.split()))
    typer.echo(f"mckibben: {plain}", err=True)
    return code
