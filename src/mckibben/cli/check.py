"""``check``: what is wrong with a tension law or a friction of one's own."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from .. import assembly, muscles
from ..errors import InputError
from ..quantities import declared, parse
from ..registry import is_reference, load_reference
from ._terminal import Json, Set, assignments, print_json


def check_law(
    name: Annotated[
        str,
        typer.Argument(
            metavar="FILE.py:CLASS", help="Class of a law or a friction in a Python file, or the name of a law."
        ),
    ],
    change: Set = None,
    lowest: Annotated[str, typer.Option(help="Lowest gauge pressure at which cycles and volume are judged.")] = "0 bar",
    as_json: Json = False,
) -> None:
    """Check a tension law or friction of your own: energy, push, potential, derivatives, units, kernel.

    The exit code is 1 when something is wrong.
    """
    kind: Any = load_reference(name, field="law") if is_reference(name) else muscles.laws.LAWS.find(name)
    known = declared(kind) if hasattr(kind, "__dataclass_fields__") else {}
    given = {}
    for key, words in assignments(change).items():
        if key not in known:
            raise InputError(f"--set {key}", words, f"{name} has {', '.join(known) or 'no parameters'}")
        given[key] = parse(words, known[key].unit, field=f"--set {key}", bare=True)
    findings = assembly.check.check(name, given, lowest=parse(lowest, "Pa", field="--lowest"))
    if as_json:
        print_json({"name": name, "findings": [finding._asdict() for finding in findings]})
    else:
        for finding in findings:
            typer.echo(f"{finding.kind}: {finding.sentence}")
        typer.echo(
            f"{len(findings)} finding{'' if len(findings) == 1 else 's'}" if findings else f"{name}: nothing is wrong"
        )
    if findings:
        raise typer.Exit(1)
