"""Commands of verbs: options, help, cautions, tables, JSON and files follow from a function and its answer."""

from __future__ import annotations

import contextlib
import functools
import inspect
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from .. import verbs
from ..answers import Answer, Table, named
from ..citations import reference
from ..errors import InputError
from ..report.figures import style
from . import _progress
from ._outputs import OutputFiles, OutputKinds, Paths
from ._terminal import (
    FigureLook,
    FigureWidth,
    Json,
    assignments,
    caution,
    expect_cautions,
    options_named,
    pairs,
    print_json,
    program,
    silence,
    table,
    writable,
)

if TYPE_CHECKING:
    from ..report.figures.page_charts import Figure

SINGULAR = {"columns": "column", "units": "unit", "scales": "scale"}  # options with the words of all commands
PAIRS = {
    "NAME=COLUMN": "force='F [N]'",
    "NAME=UNIT": "force=N",
    "NAME=SCALE": "pressure='2 bar/V'",
}  # examples of what is typed of a table
REMEDIES = {
    "sheet": "NAME",
    "decimal": ". or --decimal ,",
    "header": "'NAME [UNIT], ..'",
    "rest_length": "'300 mm'",
    "frequency": "'28 Hz'",
}  # values of options that errors ask for


class Shorthand(NamedTuple):
    """A flag that stands for a value of a parameter, such as ``--no-friction`` for a friction of 0 N."""

    parameter: str
    value: str
    about: str


class Written(NamedTuple):
    """An option that names a file to write, beside ``--out``."""

    suffixes: tuple[str, ...]
    about: str
    write: Callable[[Any, Path], object]


@dataclass(frozen=True)
class VerbCommand:
    """What the command line adds to a verb, nearly all of it words.

    Attributes:
        place: of the verb, such as ``studies.tension:tension``.
        outputs: what ``--out`` takes.
        examples: command lines.
        options: names of options that differ from those of their parameters.
        shorthands: flags that stand for a value, by name.
        required: parameters that the command line wants stated, ``out`` too.
        draw: makes the figure of an answer.
        writes: what else ``--out`` takes, by its kind in `outputs`.
        written: options that name a file each.
        top: rows of rankings that are shown and written where ``--top`` states no other; 0 for all, without the option.
        doing: word for what takes long, and the number of its stages by what was given.
        around: opens what the verb needs while it runs, such as a bar of progress, by what was given; yields values of
            further parameters.
        pairs: examples of values that are NAME=VALUE, or PATH=VALUE of what is no muscle, by parameter.
        failed: exit code where what was asked for was not reached, or tells it by the answer.
        flags: words of help of flags that the command line alone has, by name; `around` is told them.
        keep: writes what cannot be made again before all else, and tells whether there is anything to write; the answer is
            then printed before it is drawn.
        check: refuses files that what was typed cannot have, before anything is computed.
        from_files: values of parameters that follow from what was typed and the names of files, such as a specimen's id.
        note: sentence behind the words of ``--out``.
    """

    place: str
    outputs: OutputKinds
    examples: tuple[str, ...]
    options: Mapping[str, str] = field(default_factory=dict)
    shorthands: Mapping[str, Shorthand] = field(default_factory=dict)
    required: tuple[str, ...] = ()
    draw: Callable[[Any], Figure] | None = None
    writes: Mapping[str, Callable[[Any, Path], object]] = field(default_factory=dict)
    written: Mapping[str, Written] = field(default_factory=dict)
    top: int = 0
    doing: tuple[str, Callable[[Mapping[str, Any]], int | None]] | None = None
    around: Callable[[Mapping[str, Any]], AbstractContextManager[Mapping[str, Any]]] | None = None
    pairs: Mapping[str, str] = field(default_factory=dict)
    failed: int | Callable[[Any], int] = 1
    flags: Mapping[str, str] = field(default_factory=dict)
    keep: Callable[[Any, OutputFiles], bool] | None = None
    check: Callable[[Mapping[str, Any], OutputFiles], None] | None = None
    from_files: Callable[[Mapping[str, Any], OutputFiles], Mapping[str, Any]] | None = None
    note: str = ""

    def option(self, parameter: str) -> str:
        """The option of a parameter; a flag that is set by default has one that takes it away."""
        one = verbs.described(self.place).parameters.get(parameter)
        name = (SINGULAR | dict(self.options)).get(parameter, parameter).replace("_", "-")
        return f"--no-{name}" if one is not None and one.flag and one.default else f"--{name}"

    def is_argument(self, p: verbs.Parameter) -> bool:
        """Whether a parameter is typed without a name, as it is in Python unless it has an option."""
        return not p.keyword and p.name not in self.options

    def function(self) -> Callable[..., None]:
        """The function of which typer makes the parser."""
        verb = verbs.described(self.place)
        parameters = [self._parameter(one) for one in _typed(verb)]
        parameters.sort(key=lambda p: p.default is not p.empty)
        for name, one in self.shorthands.items():
            flag = Annotated[bool, typer.Option(f"--{name.replace('_', '-')}", help=one.about)]
            parameters.insert([p.name for p in parameters].index(one.parameter), _keyword(name, flag, False))
        for name, about in self.flags.items():
            option = typer.Option(f"--{name.replace('_', '-')}", help=about)
            parameters.append(_keyword(name, Annotated[bool, option], False))
        if self.draw is not None:
            parameters += [_keyword("width", FigureWidth, None), _keyword("look", FigureLook, "screen")]
        for name, written in self.written.items():
            kind = Annotated[Path | None, typer.Option(f"--{name}", metavar="OUT", help=written.about)]
            parameters.append(_keyword(name.replace("-", "_"), kind, None))
        if self.top:
            rows = typer.Option("--top", metavar="N", min=1, help="Number of rows shown of each ranking.")
            parameters.append(_keyword("top", Annotated[int, rows], self.top))
        if self.outputs.kinds:
            option = self.outputs.option(note=self.note)
            needed = "out" in self.required
            several: Any = list[Path] if needed else Paths
            parameters.append(_keyword("out", Annotated[several, option], inspect.Parameter.empty if needed else None))
        names = [p.name for p in parameters]  # in the order of all commands, whatever Python takes by position
        if {"muscle", "rig"} <= {*names} and names.index("rig") < names.index("muscle"):
            parameters.insert(names.index("rig"), parameters.pop(names.index("muscle")))
        if "out" in names and parameters[names.index("out")].default is None:
            parameters.append(parameters.pop(names.index("out")))
        parameters.append(_keyword("as_json", Json, False))

        def run(**values: Any) -> None:
            self.run(values)

        run.__name__ = verb.name
        run.__doc__ = "\n\n".join([*verb.paragraphs, "\n".join(f"$ mckibben {one}" for one in self.examples)])
        run.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
        run.__annotations__ = {p.name: p.annotation for p in parameters} | {"return": None}
        return run

    def _parameter(self, p: verbs.Parameter) -> inspect.Parameter:
        word = p.type.word
        taken: Any = list[str] if "=" in word or (p.many and not p.type.unit) else int if word == "N" else str
        if self.is_argument(p):
            optional = not p.required or (p.several and p.name not in self.required)
            taken = taken | None if optional and p.default is None else taken
            argument = typer.Argument(metavar=word, help=p.about)
            default = p.default if optional else inspect.Parameter.empty
            return inspect.Parameter(
                p.name, inspect.Parameter.POSITIONAL_OR_KEYWORD, annotation=Annotated[taken, argument], default=default
            )
        if p.flag:
            about = f"Do not {p.about[:1].lower()}{p.about[1:]}" if p.default else p.about
            return _keyword(p.name, Annotated[bool, typer.Option(self.option(p.name), help=about)], False)
        option = typer.Option(self.option(p.name), metavar=word, help=p.about, min=p.type.least)
        if p.required or p.name in self.required:
            return _keyword(p.name, Annotated[taken, option], inspect.Parameter.empty)
        default = None if p.default == () else p.default
        if taken == list[str] and isinstance(default, str):
            default = [default]
        return _keyword(p.name, Annotated[taken if default is not None else taken | None, option], default)

    def run(self, values: dict[str, Any]) -> None:
        """Ask the verb, write and print its answer; `values` are those of the parser, by parameter."""
        verb = verbs.described(self.place)
        as_json, top = values.pop("as_json"), values.pop("top", None)
        paths = values.pop("out") if self.outputs.kinds else None
        beside = {name: values.pop(name.replace("-", "_")) for name in self.written}
        for name, path in beside.items():
            writable(f"--{name}", path, *self.written[name].suffixes)
        with self.outputs.files(paths) as files:
            if self.check is not None:
                self.check(values, files)
            with silence() if as_json else contextlib.nullcontext():  # whatever is told meanwhile
                more_values = {} if self.from_files is None else self.from_files(values, files)
                answer = self._answer(verb, values, more_values, as_json)
            expect_cautions(())  # the answer has those about typed values
            draw = self.draw
            draws = {} if draw is None else {"figure": lambda answer, path: style.save(draw(answer), path)}
            writes = self.writes if self.keep is not None else {**draws, **self.writes}
            written = self.keep is None or self.keep(answer, files)
            more: list[str] = []  # files that go with those that were named
            about: list[str] = []  # what is said of files
            for kind, write in writes.items():
                files.write(kind, functools.partial(_written, write, answer, more, about))
            for name, path in beside.items():
                if path is not None:
                    self.written[name].write(answer, path)
            failure = answer.failure()
            answer = answer if top is None else answer.first(top)
            content = answer.to_dict()
            content["warnings"] = [*dict.fromkeys((*content.get("warnings", ()), *caution(*answer.cautions)))]
            if "recording" in self.outputs.kinds:
                recorded = files.first("recording") if written else None
                content["file"] = None if recorded is None else str(recorded)
            if more:
                content["files"] = more
            if about:
                content["about_files"] = [named(one, self._called) for one in about]
            if files["table"]:
                files.write_columns(answer.data(), answer.column_units())
            if "result" in self.outputs.kinds:
                files.write_result(content)
            if as_json:
                print_json(content)
            else:
                show(answer, self._called)
            for kind, write in draws.items() if self.keep is not None and written else ():
                files.write(kind, functools.partial(write, answer))
            if not as_json:
                files.say(None if written else "result")
                named_paths = [str(path) for path in files.named()]
                for path in (*filter(None, beside.values()), *(one for one in more if one not in named_paths)):
                    typer.echo(f"Written: {path}")
                for sentence in content.get("about_files", ()):
                    typer.echo(sentence)
        for line in (failure or "").splitlines():
            typer.echo(f"{program(31)}: {line}", err=True)
        if failure is not None:
            raise typer.Exit(self.failed(answer) if callable(self.failed) else self.failed)

    def _answer(
        self, verb: verbs.Description, values: dict[str, Any], more: Mapping[str, Any], as_json: bool
    ) -> Answer:
        for name, one in self.shorthands.items():
            if values[name]:
                if values[one.parameter] is not None:
                    raise InputError(
                        self.option(one.parameter), None, f"is allowed only without --{name.replace('_', '-')}"
                    )
                values[one.parameter] = one.value
        given = {p.name: self._given(p, values[p.name]) for p in _typed(verb) if values[p.name] not in (None, (), [])}
        given |= more
        for p in verb.parameters.values():
            if p.parts:
                stated = {part.name: given.pop(part.name) for part in p.parts if part.name in given}
                given |= {p.name: stated} if stated else {}
        ask = functools.partial(verbs.answer, verbs.load(self.place), shown=self._called)
        with options_named(**{name: f"{self.option(name)} {value}" for name, value in REMEDIES.items()}):
            if self.around is not None:
                with self.around(given | {name: values[name] for name in self.flags} | {"as_json": as_json}) as opened:
                    return ask(given | dict(opened))
            if self.doing is None:
                return ask(given)
            title, stages = self.doing
            with _progress.told(title, stages(given)) as tell:
                return ask(given | {"progress": tell})

    def _called(self, parameter: str) -> str:
        one = verbs.described(self.place).parameters.get(parameter)
        return parameter if one is not None and self.is_argument(one) else self.option(parameter)

    def _given(self, p: verbs.Parameter, value: Any) -> Any:
        """A value as the verb takes it: of NAME=VALUE a table, in which columns may be numbers."""
        word = p.type.word
        if p.flag and p.default:
            return not value  # --no-lines
        if word == "PATH=VALUE" and p.name not in self.pairs:
            return assignments(value)
        if "=" not in word:
            return value
        named = pairs(value, self.option(p.name), self.pairs.get(p.name) or PAIRS[word])
        return {name: int(one) if word == "NAME=COLUMN" and one.isdecimal() else one for name, one in named.items()}


class Alternative(NamedTuple):
    """A verb that answers in the place of a command's first one.

    Attributes:
        command: of the verb.
        typed: what is typed for it, such as ``--friction``.
        asked: whether that was typed, by the values of all options.
        flag: words of help, where what is typed is a flag that no verb has.
    """

    command: VerbCommand
    typed: str
    asked: Callable[[Mapping[str, Any]], bool]
    flag: str = ""

    def flag_option(self) -> dict[str, inspect.Parameter]:
        """The flag by its parameter, if it has one."""
        name = self.typed.removeprefix("--").replace("-", "_")
        option = Annotated[bool, typer.Option(self.typed, help=self.flag)]
        return {name: _keyword(name, option, False)} if self.flag else {}


@dataclass(frozen=True)
class VerbsCommand:
    """One command of several verbs: it has the options of all, and one of them answers.

    Attributes:
        first: answers where no other is asked; its words are the help.
        others: answer where what is theirs was typed. The arguments of the first are theirs, one by one.
    """

    first: VerbCommand
    others: tuple[Alternative, ...]

    def function(self) -> Callable[..., None]:
        """The function of which typer makes the parser."""
        run = self.first.function()
        own = inspect.signature(run).parameters
        options = {a.typed: _options(a.command) | a.flag_option() for a in self.others}
        added = {name: _optional(p) for of in options.values() for name, p in of.items() if name not in own}
        end = next(i for i, name in enumerate(own) if name in ("width", "out"))
        parameters = [*own.values()]
        parameters[end:end] = added.values()

        def choose(**values: Any) -> None:
            typed = [name for name, value in values.items() if value and value != signature[name].default]
            chosen = next((a for a in self.others if a.asked(values)), None)
            for other in self.others:
                for name in typed:
                    if chosen is None and name in options[other.typed] and name not in own:
                        raise InputError(_spelled(signature[name]), None, f"is allowed only with {other.typed}")
            if chosen is None:
                return run(**{name: values[name] for name in own})
            for name in typed:
                if name in own and name not in ("out", "as_json", *arguments, *options[chosen.typed]):
                    raise InputError(_spelled(signature[name]), None, f"is allowed only without {chosen.typed}")
            return chosen.command.run(self._values(chosen, values, arguments))

        signature = {p.name: p for p in parameters}
        arguments = [p.name for p in parameters if p.kind is p.POSITIONAL_OR_KEYWORD]
        choose.__name__, choose.__doc__ = run.__name__, run.__doc__
        choose.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
        choose.__annotations__ = {p.name: p.annotation for p in parameters} | {"return": None}
        return choose

    def _values(self, chosen: Alternative, values: Mapping[str, Any], arguments: Sequence[str]) -> dict[str, Any]:
        """Values of the chosen verb: arguments and options of which it takes one are no lists."""
        known = verbs.described(chosen.command.place).parameters
        for path in values["out"] or () if self.first.outputs.kinds else ():
            kind = "" if str(path) == "-" else self.first.outputs.placed(path)[0]
            if kind and kind not in chosen.command.outputs.kinds:
                raise InputError("--out", None, f"is allowed only without {chosen.typed} for the {kind} {path}")
        given = [one for name in arguments for one in values[name]]
        found = {name: values[name] for name in (*_options(chosen.command), "out", "as_json") if name in values}
        for name, p in known.items():
            if isinstance(found.get(name), list) and not p.many and "=" not in p.type.word:
                if len(found[name]) > 1:
                    problem = f"must be one {name} beside {chosen.typed}"
                    raise InputError(chosen.command.option(name), ", ".join(found[name]), problem)
                found[name] = found[name][0]
        if not given:
            return found
        takes = next(name for name, p in known.items() if not p.keyword)
        if len(given) > 1:
            raise InputError("file", ", ".join(given), f"must be one {takes}, alone")
        return found | {takes: given[0]}


def _options(command: VerbCommand) -> dict[str, inspect.Parameter]:
    """Options of a verb's command by their parameters, without its arguments and those of all commands."""
    parameters = inspect.signature(command.function()).parameters.values()
    return {p.name: p for p in parameters if p.kind is p.KEYWORD_ONLY and p.name not in ("out", "as_json")}


def _written(
    write: Callable[[Any, Path], object], answer: Answer, more: list[str], about: list[str], path: Path
) -> None:
    """Write a file; `more` gets the names of all where there are several, `about` the sentence about it if there is one."""
    said = write(answer, path)
    more += [str(one) for one in said] if isinstance(said, list) else []
    about += [f"{path}: {said}"] if isinstance(said, str) and said else []


def _optional(p: inspect.Parameter) -> inspect.Parameter:
    """An option that may be left out, where its own verb needs it."""
    if p.default is not p.empty:
        return p
    taken, option = p.annotation.__origin__, p.annotation.__metadata__[0]
    return p.replace(annotation=Annotated[taken | None, option], default=None)


def _spelled(p: inspect.Parameter) -> str:
    """An option as it is typed."""
    option = p.annotation.__metadata__[0]
    names = [str(name) for name in (option.default, *(option.param_decls or ()))]
    return next((name for name in names if name.startswith("--")), f"--{p.name.replace('_', '-')}")


def _typed(verb: verbs.Description) -> Iterator[verbs.Parameter]:
    """What a person types of a verb; what has no kind of value is for Python alone."""
    for one in verb.parameters.values():
        yield from (part for part in one.parts or (one,) if part.type.word or part.flag)


def _keyword(name: str, annotation: Any, default: Any) -> inspect.Parameter:
    return inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, annotation=annotation, default=default)


def show(answer: Answer, called: Callable[[str], str] = str) -> None:
    """Print an answer for people: tables, and sentences below them, which call parameters as `called` does."""
    tables = answer.tables()
    show_tables(tables, called)
    remarks = answer.remarks()
    typer.echo("\n" if len(tables) > 1 and remarks else "", nl=False)
    for remark in remarks:
        typer.echo(named(remark, called))
    typer.echo("\n" if answer.sources else "", nl=False)
    for key in answer.sources:
        typer.echo(f"[{key}] {reference(key)}")


def show_tables(tables: Sequence[Table], called: Callable[[str], str] = str) -> None:
    """Print tables for people, each with its sentences below."""
    for i, one in enumerate(tables):
        typer.echo("\n" if i else "", nl=False)
        cells = [[_plain(cell) for cell in row] for row in one.cells()]
        said = [str(row[one.below]) for row in one.rows] if one.below else None
        table(_plain(one.title), one.heads, cells[: one.most], right=one.right, below=said)
        if len(cells) > len(cells[: one.most]):
            typer.echo(f"... and {len(cells) - len(cells[: one.most])} more; --json lists all.")
        for note in one.notes:
            typer.echo(named(note, called))


def _plain(text: str) -> str:
    return text.replace("[", "\\[")  # no markup of rich
