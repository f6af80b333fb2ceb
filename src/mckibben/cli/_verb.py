"""Commands of verbs: options, help, cautions, tables, JSON and files follow from a function and its answer."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import typer

from .. import verbs
from ..answers import Answer
from ..citations import reference
from ..errors import InputError
from . import _progress
from ._outputs import OutputKinds, Paths
from ._terminal import (
    FigureLook,
    FigureWidth,
    Json,
    assignments,
    caution,
    expect_cautions,
    pairs,
    print_json,
    program,
    table,
    writable,
)


class Shorthand(NamedTuple):
    """A flag that stands for a value of a parameter, such as ``--no-friction`` for a friction of 0 N."""

    parameter: str
    value: str
    about: str


class Written(NamedTuple):
    """An option that names a file to write, beside ``--out``."""

    suffix: str
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
        required: parameters that the command line wants stated.
        draw: draws the figure of an answer into a file.
        writes: what else ``--out`` takes, by its kind in `outputs`.
        written: options that name a file each.
        top: rows of rankings that are shown and written where ``--top`` states no other; 0 for all, without the option.
        doing: word for what takes long, and the number of its stages by what was given.
        pair: example of a value that is NAME=VALUE.
        failed: exit code where what was asked for was not reached.
    """

    place: str
    outputs: OutputKinds
    examples: tuple[str, ...]
    options: Mapping[str, str] = field(default_factory=dict)
    shorthands: Mapping[str, Shorthand] = field(default_factory=dict)
    required: tuple[str, ...] = ()
    draw: Callable[[Any, Path], object] | None = None
    writes: Mapping[str, Callable[[Any, Path], object]] = field(default_factory=dict)
    written: Mapping[str, Written] = field(default_factory=dict)
    top: int = 0
    doing: tuple[str, Callable[[Mapping[str, Any]], int | None]] | None = None
    pair: str = ""
    failed: int = 1

    def option(self, parameter: str) -> str:
        """The option of a parameter, an argument's own name; a flag that is set by default has one that takes it away."""
        one = verbs.described(self.place).parameters[parameter]
        name = self.options.get(parameter, parameter).replace("_", "-")
        if one.required:
            return name
        return f"--no-{name}" if one.flag and one.default else f"--{name}"

    def function(self) -> Callable[..., None]:
        """The function of which typer makes the parser."""
        verb = verbs.described(self.place)
        parameters = [self._parameter(one) for one in verb.parameters.values() if one.flag or one.type.word]
        parameters.sort(key=lambda p: p.default is not p.empty)
        for name, one in self.shorthands.items():
            flag = Annotated[bool, typer.Option(f"--{name.replace('_', '-')}", help=one.about)]
            parameters.insert([p.name for p in parameters].index(one.parameter), _keyword(name, flag, False))
        if self.draw is not None:
            parameters += [_keyword("width", FigureWidth, None), _keyword("look", FigureLook, "screen")]
        for name, written in self.written.items():
            kind = Annotated[Path | None, typer.Option(f"--{name}", metavar="OUT", help=written.about)]
            parameters.append(_keyword(name, kind, None))
        if self.top:
            rows = typer.Option("--top", metavar="N", min=1, help="Number of rows shown of each ranking.")
            parameters.append(_keyword("top", Annotated[int, rows], self.top))
        parameters += [_keyword("out", Annotated[Paths, self.outputs.option()], None), _keyword("as_json", Json, False)]

        def run(**values: Any) -> None:
            self._run(verb, values)

        run.__name__ = verb.name
        run.__doc__ = "\n\n".join([*verb.paragraphs, "\n".join(f"$ mckibben {one}" for one in self.examples)])
        run.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
        run.__annotations__ = {p.name: p.annotation for p in parameters} | {"return": None}
        return run

    def _parameter(self, p: verbs.Parameter) -> inspect.Parameter:
        word = p.type.word
        if p.required:
            kind = Annotated[list[str] | None if p.many else str, typer.Argument(metavar=word, help=p.about)]
            default = None if p.many else inspect.Parameter.empty
            return inspect.Parameter(p.name, inspect.Parameter.POSITIONAL_OR_KEYWORD, annotation=kind, default=default)
        if p.flag:
            about = f"Do not {p.about[:1].lower()}{p.about[1:]}" if p.default else p.about
            return _keyword(p.name, Annotated[bool, typer.Option(self.option(p.name), help=about)], False)
        repeated = word in ("PATH=VALUE", "NAME=VALUE") or (p.many and not p.type.unit)
        taken: Any = list[str] if repeated else str
        option = typer.Option(self.option(p.name), metavar=word, help=p.about)
        if p.name in self.required:
            return _keyword(p.name, Annotated[taken, option], inspect.Parameter.empty)
        return _keyword(p.name, Annotated[taken if p.default is not None else taken | None, option], p.default)

    def _run(self, verb: verbs.Description, values: dict[str, Any]) -> None:
        paths, as_json, top = values.pop("out"), values.pop("as_json"), values.pop("top", None)
        beside = {name: values.pop(name) for name in self.written}
        for name, path in beside.items():
            writable(f"--{name}", path, self.written[name].suffix)
        with self.outputs.files(paths) as files:
            answer = self._answer(verb, values)
            expect_cautions(())  # the answer has those about typed values
            writes = self.writes if self.draw is None else {"figure": self.draw, **self.writes}
            for kind, write in writes.items():
                files.write(kind, functools.partial(write, answer))
            for name, path in beside.items():
                if path is not None:
                    self.written[name].write(answer, path)
            failure = answer.failure()
            answer = answer if top is None else answer.first(top)
            content = answer.to_dict() | {"warnings": caution(*answer.cautions)}
            files.write_rows(answer.rows(), answer.units)
            files.write_result(content)
            if as_json:
                print_json(content)
            else:
                show(answer)
                files.say()
                for path in filter(None, beside.values()):
                    typer.echo(f"Written: {path}")
        if failure:
            typer.echo(f"{program(31)}: {failure}", err=True)
        if failure is not None:
            raise typer.Exit(self.failed)

    def _answer(self, verb: verbs.Description, values: dict[str, Any]) -> Answer:
        for name, one in self.shorthands.items():
            if values[name]:
                if values[one.parameter] is not None:
                    raise InputError(
                        self.option(one.parameter), None, f"is allowed only without --{name.replace('_', '-')}"
                    )
                values[one.parameter] = one.value
        given = {name: values[name] for name in verb.parameters if values.get(name) is not None}
        for name in given:
            if verb.parameters[name].flag and verb.parameters[name].default:
                given[name] = not given[name]  # --no-lines
        for name in given:
            if verb.parameters[name].type.word == "PATH=VALUE":
                given[name] = assignments(given[name])
            elif verb.parameters[name].type.word == "NAME=VALUE":
                given[name] = pairs(given[name], self.option(name), self.pair)
        ask = functools.partial(verbs.answer, verbs.load(self.place), shown=self.option)
        if self.doing is None:
            return ask(given)
        title, stages = self.doing
        with _progress.told(title, stages(given)) as tell:
            return ask(given | {"progress": tell})


def _keyword(name: str, annotation: Any, default: Any) -> inspect.Parameter:
    return inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, annotation=annotation, default=default)


def show(answer: Answer) -> None:
    """Print an answer for people: tables, and sentences below them."""
    tables = answer.tables()
    for i, one in enumerate(tables):
        typer.echo("\n" if i else "", nl=False)
        table(one.title, one.heads, one.cells(), right=one.right)
        for note in one.notes:
            typer.echo(note)
    remarks = answer.remarks()
    typer.echo("\n" if len(tables) > 1 and remarks else "", nl=False)
    for remark in remarks:
        typer.echo(remark)
    typer.echo("\n" if answer.sources else "", nl=False)
    for key in answer.sources:
        typer.echo(f"[{key}] {reference(key)}")
