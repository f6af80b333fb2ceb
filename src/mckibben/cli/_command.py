"""What all commands have in common: help, ``-`` for standard input, ``--quiet``, cautions.

A command is a function with annotated parameters and a docstring; typer makes the parser of it. Everything here works on the
parameters of that parser, so that a new command has it without a line of its own.
"""

from __future__ import annotations

import contextlib
import functools
import inspect
import re
import shutil
import sys
import tempfile
import textwrap
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import typer
import typer.core

from ..documents import path_text
from ..errors import InputError
from ..registry import allow_code, named_by_person
from . import _progress, _terminal, _values

WIDEST = 100  # columns of a help text; longer lines are hard to read
EXAMPLE = "$ "  # begins a line of a docstring that is an example

# Commands that end by Ctrl-C in their own way, or work with a machine that is vented first.
OWN_INTERRUPTS = (
    "console", "device check", "device serve", "serve", "calibrate zero", "calibrate weights", "calibrate pressure",
    "calibrate encoder", "calibrate skew",
)  # fmt: skip
QUIET = ("-q", "--quiet")
# Options that count only beside another, or only without it, by the command: what nothing takes is not ignored.
WITH, WITHOUT = True, False
_SIMULATED = (("--seed", WITH, "--simulate"),)
CONDITIONS: dict[str, tuple[tuple[str, bool, str], ...]] = {
    "joint": (
        *((option, WITH, "--angle") for option in ("--stiffness", "--seed")),
        *((option, WITHOUT, "--angle") for option in ("--supply", "--valve", "--start-pressure", "--period")),
    ),
    "fit": (("--draws", WITH, "--posterior"),),
    "circuit fit": (("--draws", WITH, "--posterior"),),
    "run": (("--draws", WITH, "--from-posterior"),),
    "reproduce": (("--format", WITH, "--figure"),),
    "device check": _SIMULATED,
    **{f"calibrate {name}": _SIMULATED for name in ("zero", "weights", "pressure", "encoder", "skew")},
}
COMMON = (
    ("--code FILE.py", "Python file of your own that names in files, such as my.py:MyLaw, may run. [repeatable]"),
    ("-q, --quiet", "Print only errors, and what --json or --out - asks for."),
    ("-h, --help", "Show this help and exit."),
)


class HelpEntry(NamedTuple):
    """A line of the help: what is typed, and what it means."""

    words: str
    meaning: str


class PlainValue:
    """Conversion of words that need none: text, paths, lists of them, and numbers that were not typed.

    The parser has every value converted by a library whose import takes longer than most commands. It is left what is typed
    and is no text.

    Args:
        param: a parameter of the parser.
        kind: ``str``, ``Path``, ``int``, ``float`` or ``bool``.
    """

    def __init__(self, param: Any, kind: type) -> None:
        self._kind, self._usual = kind, type(param).get_runtime_param

    def coerce(self, value: Any, param: Any, ctx: Any) -> Any:
        """Convert the value of a parameter."""
        if value is None:
            return () if param.multiple or param.nargs == -1 else None
        if self._kind in (str, Path):
            words = [value] if isinstance(value, str) else value if isinstance(value, list | tuple) else []
            for one in words if self._kind is Path else ():
                path_text(one, max(param.opts, key=len) if param.param_type_name == "option" else param.name)
            if isinstance(value, str):
                return self._kind(value)
            if isinstance(value, list | tuple) and all(isinstance(one, str) for one in value):
                return [self._kind(one) for one in value]
        elif type(value) is self._kind and value == param.default:
            return value
        return self._usual(param).coerce(value, param=param, ctx=ctx)


PLAIN: dict[object, type] = {str: str, Path: Path, int: int, float: float, bool: bool, list[str]: str, list[Path]: Path}


def with_plain_values(params: list[Any]) -> list[Any]:
    """Parameters that convert text by themselves; those of a typer that loads no library for it as they are."""
    for param in params:
        described: Any = getattr(param, "type_descriptor", None)
        kind = PLAIN.get(getattr(described, "annotation", object))
        if kind is not None and hasattr(param, "get_runtime_param") and described.parameter_info.parser is None:
            param.get_runtime_param = functools.partial(PlainValue, param, kind)
    return params


class CommandWithHelp(typer.core.TyperCommand):
    """A command of the table in `app`."""

    words = ""  # of the command line, such as "circuit run"

    def get_params(self, ctx: Any) -> list[Any]:
        """Parameters and the option of the help."""
        return with_plain_values(super().get_params(ctx))

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Parse the words of the command line, without those that every command takes."""
        args = _without_code(args)
        end = args.index("--") if "--" in args else len(args)
        words = [word for word in args[:end] if word not in QUIET]
        if len(words) < end:
            _terminal.be_quiet()
        rest: list[str] = super().parse_args(ctx, words + args[end:])
        return rest

    def invoke(self, ctx: Any) -> Any:
        """Call the function with ``-`` for standard input resolved, and cautions about unlikely values."""
        self._check_conditions(ctx)
        # Allow the Python files that options and arguments name as `my.py:MyLaw` or `--set KEY=my.py:MyLaw`
        for param in self.params:
            value = ctx.params.get(param.name)
            for word in value if isinstance(value, list | tuple) else (value,):
                if isinstance(word, str):
                    named_by_person(word, word.partition("=")[2], *word.split(","))
        with _standard_input(self.params, ctx.params) as values:
            ctx.params.update(values)
            _terminal.expect_cautions(_values.cautions(self.params, ctx.params))
            with (
                _terminal.silenced(),
                _terminal.cautions_of_python(),
                _progress.protected() if self.words in OWN_INTERRUPTS else contextlib.nullcontext(),
            ):
                result = super().invoke(ctx)
        _terminal.say_cautions()
        return result

    def _check_conditions(self, ctx: Any) -> None:
        """Refuse an option that was typed where it does not count."""
        typed = {
            option
            for param in self.params
            if param.param_type_name == "option" and ctx.get_parameter_source(param.name).name == "COMMANDLINE"
            for option in param.opts
        }
        for option, beside, other in CONDITIONS.get(self.words, ()):
            if option in typed and (other in typed) is not beside:
                raise InputError(option, None, f"is allowed only {'with' if beside else 'without'} {other}")

    def format_help(self, ctx: Any, formatter: Any) -> None:
        """Write the help: usage, description, arguments, options and examples."""
        formatter.write(help_text(self, ctx.command_path, help_width()))


def help_width() -> int:
    """Columns of a help text: those of the terminal, up to 100."""
    return max(40, min(shutil.get_terminal_size((80, 24)).columns, WIDEST))


# ---- code of one's own


def _without_code(args: list[str]) -> list[str]:
    """Words without ``--code FILE.py``; the files are allowed."""
    words: list[str] = []
    rest = iter(args)
    for word in rest:
        if word == "--":
            return [*words, word, *rest]
        name, equals, path = word.partition("=")
        if name != "--code":
            words.append(word)
            continue
        path = path if equals else next(rest, "")
        allow_code(path)
    return words


# ---- standard input


@contextlib.contextmanager
def _standard_input(params: list[Any], values: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """Put what is piped in into a file, for parameters that name files and are given as ``-``."""
    asked = [p for p in params if _values.is_input(p) and _has_dash(values.get(p.name))]
    if not asked:
        yield {}
        return
    with tempfile.TemporaryDirectory(prefix="mckibben-") as folder:
        data = sys.stdin.buffer.read() if hasattr(sys.stdin, "buffer") else sys.stdin.read().encode()
        path = Path(folder) / f"stdin{_suffix(data)}"
        path.write_bytes(data)
        _terminal.call_path(str(path), "standard input")
        yield {p.name: _put(values[p.name], path) for p in asked}


def _has_dash(value: Any) -> bool:
    return any(str(one) == "-" for one in value) if isinstance(value, list | tuple) else str(value) == "-"


def _put(value: Any, path: Path) -> Any:
    if isinstance(value, list | tuple):
        return [_put(one, path) for one in value]
    return type(value)(path) if str(value) == "-" else value


_BEGINNINGS = {
    b"\x89HDF": ".nc", b"CDF": ".nc", b"\x89MCAP": ".mcap", b"PK\x03\x04": ".xlsx", b"PAR1": ".parquet", b"MATLAB": ".mat",
    b"TDSm": ".tdms",
}  # fmt: skip


def _suffix(data: bytes) -> str:
    """Suffix of a file with this content."""
    for beginning, suffix in _BEGINNINGS.items():
        if data.startswith(beginning):
            return suffix
    lines = (line.strip() for line in data[:4096].decode("utf-8", "replace").splitlines())
    first = next((line for line in lines if line and not line.startswith("#")), "")
    return ".toml" if re.match(r"\[|[\w.\"-]+\s*=\s", first) else ".csv"


# ---- help


def help_text(command: Any, path: str, width: int) -> str:
    """The help of a command, no line wider than a width and no word or quoted value cut."""
    description, examples = described(command)
    sections = [f"Usage: {usage(command, path)}", *(_filled(paragraph, width, "  ") for paragraph in description)]
    arguments, options = entries(command)
    for title, rows in (("Arguments", arguments), ("Options", options)):
        if rows:
            sections.append(f"{title}:\n{_rows(rows, width)}")
    if examples:
        sections.append("\n".join([f"Example{'s' if len(examples) > 1 else ''}:", *(f"  {one}" for one in examples)]))
    return "\n\n".join(sections) + "\n"


def described(command: Any) -> tuple[list[str], list[str]]:
    """Paragraphs of a command's description, and its examples."""
    paragraphs, examples = [], []
    for paragraph in inspect.cleandoc(command.help or "").split("\n\n"):
        lines = paragraph.splitlines()
        examples += [line.strip().removeprefix(EXAMPLE) for line in lines if line.strip().startswith(EXAMPLE)]
        text = " ".join(line.strip() for line in lines if not line.strip().startswith(EXAMPLE))
        if text:
            paragraphs.append(text)
    return paragraphs, examples


def usage(command: Any, path: str) -> str:
    """The usage line: required arguments and options by name."""
    words = [path]
    for p in command.params:
        if p.param_type_name == "argument":
            name = _metavar(p) + (" .." if p.nargs != 1 else "")
            words.append(name if p.required else f"[{name}]")
    words += [f"{p.opts[0]} {_metavar(p)}" for p in command.params if p.param_type_name == "option" and p.required]
    return " ".join([*words, "[OPTIONS]"])


def entries(command: Any) -> tuple[list[HelpEntry], list[HelpEntry]]:
    """Arguments and options of a command with their meaning, bounds and default."""
    arguments, options = [], []
    for p in command.params:
        if getattr(p, "hidden", False):
            continue
        meaning = " ".join(part for part in ((p.help or "").strip(), _remark(p)) if part)
        if p.param_type_name == "argument":
            arguments.append(HelpEntry(_metavar(p), meaning))
        else:
            names = ", ".join(p.opts) + (f" / {', '.join(p.secondary_opts)}" if p.secondary_opts else "")
            options.append(HelpEntry(names if getattr(p, "is_flag", False) else f"{names} {_metavar(p)}", meaning))
    return arguments, options + [HelpEntry(*one) for one in COMMON]


def _remark(p: Any) -> str:
    """Whether a parameter is required or repeatable, and its default."""
    parts = []
    if p.required:
        parts.append("required")
    if getattr(p, "multiple", False) or p.nargs == -1:
        parts.append("repeatable")
    if p.secondary_opts:
        parts.append(f"default: {(p.opts if p.default else p.secondary_opts)[0]}")
    elif p.default not in (None, "", False) and not callable(p.default):
        parts.append(f"default: {p.default}")
    return f"[{'; '.join(parts)}]" if parts else ""


def _metavar(p: Any) -> str:
    return str(p.metavar or p.name.upper())


def rows_of_help(rows: list[tuple[str, str]], width: int) -> str:
    """Two columns: names, and what they mean."""
    return _rows([HelpEntry(*row) for row in rows], width)


def _rows(rows: list[HelpEntry], width: int) -> str:
    column = min(max(len(row.words) for row in rows), 28 if width < 90 else 34) + 4
    lines = []
    for row in rows:
        text = _filled(row.meaning, width, " " * column)
        head = f"  {row.words}"
        lines.append(head.ljust(column) + text.lstrip() if len(head) + 2 <= column else f"{head}\n{text}")
    return "\n".join(lines)


def _filled(text: str, width: int, indent: str) -> str:
    """Fill lines; a quoted value such as '12 cm', a number with its unit and a hyphenated word stay whole."""
    whole = re.sub(r"'[^']{1,40}'", lambda quoted: quoted[0].replace(" ", "\0"), text)
    filled = textwrap.fill(
        whole, width, initial_indent=indent, subsequent_indent=indent, break_long_words=False, break_on_hyphens=False
    )
    return filled.replace("\0", " ")
