"""Commands of verbs: options, help, cautions, tables, JSON and files follow from a function and its answer."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import typer

from .. import verbs
from ..answers import Answer
from ..errors import InputError
from ._outputs import OutputKinds, Paths
from ._terminal import FigureLook, FigureWidth, Json, assignments, caution, expect_cautions, print_json, table


class Shorthand(NamedTuple):
    """A flag that stands for a value of a parameter, such as ``--no-friction`` for a friction of 0 N."""

    parameter: str
    value: str
    about: str


@dataclass(frozen=True)
class VerbCommand:
    """What the command line adds to a verb, nearly all of it words.

    Attributes:
        place: of the verb, such as ``studies.tension:tension``.
        outputs: what ``--out`` takes.
        examples: command lines.
        options: names of options that differ from those of their parameters.
        shorthands: flags that stand for a value, by name.
        draw: draws the figure of an answer into a file.
    """

    place: str
    outputs: OutputKinds
    examples: tuple[str, ...]
    options: Mapping[str, str] = field(default_factory=dict)
    shorthands: Mapping[str, Shorthand] = field(default_factory=dict)
    draw: Callable[[Any, Path], object] | None = None

    def option(self, parameter: str) -> str:
        """The option of a parameter."""
        return f"--{self.options.get(parameter, parameter).replace('_', '-')}"

    def function(self) -> Callable[..., None]:
        """The function of which typer makes the parser."""
        verb = verbs.described(self.place)
        parameters = [self._parameter(one) for one in verb.parameters.values()]
        for name, one in self.shorthands.items():
            flag = Annotated[bool, typer.Option(f"--{name.replace('_', '-')}", help=one.about)]
            parameters.insert([p.name for p in parameters].index(one.parameter), _keyword(name, flag, False))
        if self.draw is not None:
            parameters += [_keyword("width", FigureWidth, None), _keyword("look", FigureLook, "screen")]
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
            kind = Annotated[str, typer.Argument(metavar=word, help=p.about)]
            return inspect.Parameter(p.name, inspect.Parameter.POSITIONAL_OR_KEYWORD, annotation=kind)
        if p.flag:
            return _keyword(p.name, Annotated[bool, typer.Option(self.option(p.name), help=p.about)], p.default)
        repeated = word == "PATH=VALUE" or (p.many and not p.type.unit)
        taken: Any = list[str] if repeated else str
        option = typer.Option(self.option(p.name), metavar=word, help=p.about)
        return _keyword(p.name, Annotated[taken if p.default is not None else taken | None, option], p.default)

    def _run(self, verb: verbs.Description, values: dict[str, Any]) -> None:
        paths, as_json = values.pop("out"), values.pop("as_json")
        with self.outputs.files(paths) as files:
            answer = self._answer(verb, values)
            expect_cautions(())  # the answer has those about typed values
            content = answer.to_dict() | {"warnings": caution(*answer.cautions)}
            if self.draw is not None:
                draw = self.draw
                files.write("figure", lambda path: draw(answer, path))
            files.write_rows(answer.rows(), answer.units)
            files.write_result(content)
            if as_json:
                print_json(content)
            else:
                show(answer)
                files.say()

    def _answer(self, verb: verbs.Description, values: dict[str, Any]) -> Answer:
        for name, one in self.shorthands.items():
            if values[name]:
                if values[one.parameter] is not None:
                    raise InputError(
                        self.option(one.parameter), None, f"is allowed only without --{name.replace('_', '-')}"
                    )
                values[one.parameter] = one.value
        given = {name: values[name] for name in verb.parameters if values[name] is not None}
        for name in given:
            if verb.parameters[name].type.word == "PATH=VALUE":
                given[name] = assignments(given[name])
        return verbs.answer(verbs.load(self.place), given, self.option)


def _keyword(name: str, annotation: Any, default: Any) -> inspect.Parameter:
    return inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, annotation=annotation, default=default)


def show(answer: Answer) -> None:
    """Print an answer for people: tables, and sentences below them."""
    tables = answer.tables()
    for i, one in enumerate(tables):
        typer.echo("\n" if i else "", nl=False)
        table(one.title, one.heads, one.cells(), right=one.right)
    typer.echo("\n" if len(tables) > 1 else "", nl=False)
    for remark in answer.remarks():
        typer.echo(remark)
