"""``check``: what is wrong with a tension law or a friction of one's own."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from .. import assembly, muscles
from ..errors import InputError
from ..quantities import declared, parse
from ..registry import is_reference, load_reference
from ._outputs import OBJECT, OutputKinds, Paths
from ._terminal import Json, Set, assignments, print_json

OUT = OutputKinds(result=OBJECT)


def check_law(
    name: Annotated[
        str,
        typer.Argument(
            metavar="LAW|FILE.py:CLASS", help="Class of a law or a friction in a Python file, or the name of a law."
        ),
    ],
    change: Set = None,
    lowest: Annotated[
        str, typer.Option(metavar="PRESSURE", help="Lowest gauge pressure at which cycles and volume are judged.")
    ] = "0 bar",
    out: Annotated[Paths, OUT.option()] = None,
    as_json: Json = False,
) -> None:
    """Check a tension law or friction of your own: energy, push, potential, derivatives, units, kernel.

    The exit code is 1 when something is wrong.

    $ mckibben check my.py:MyLaw --set rest_length='30 cm'
    """
    with OUT.files(out) as files:
        findings = assembly.check.check(name, _given(name, change), lowest=parse(lowest, "Pa", field="--lowest"))
        content = {"name": name, "findings": [finding._asdict() for finding in findings]}
        files.write_result(content)
        if as_json:
            print_json(content)
        else:
            for finding in findings:
                typer.echo(f"{finding.kind}: {finding.sentence}")
            several = "" if len(findings) == 1 else "s"
            typer.echo(f"{len(findings)} finding{several}" if findings else f"{name}: nothing is wrong")
            files.say()
    if findings:
        raise typer.Exit(1)


def _given(name: str, change: list[str] | None) -> dict[str, float]:
    """Parameters of ``--set`` [SI]."""
    kind: Any = load_reference(name, field="law") if is_reference(name) else muscles.laws.LAWS.find(name)
    known = declared(kind) if hasattr(kind, "__dataclass_fields__") else {}
    values = {}
    for key, words in assignments(change).items():
        if key not in known:
            raise InputError(f"--set {key}", words, f"{name} has {', '.join(known) or 'no parameters'}")
        values[key] = parse(words, known[key].unit, field=f"--set {key}", bare=True)
    return values
