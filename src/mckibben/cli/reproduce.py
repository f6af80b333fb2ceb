"""``reproduce``: the papers' numbers, row by row."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from .words import Json, print_json, progress, table


def add_to(app: typer.Typer) -> None:
    """Add this command to the table."""
    app.command("reproduce")(reproduce)


def reproduce(
    part: Annotated[str | None, typer.Option(help="Only one part: I, II, III, IV or discussion.")] = None,
    row: Annotated[
        list[str] | None, typer.Option("--row", help="Only rows whose name begins so, such as table1.nylon.")
    ] = None,
    recordings: Annotated[
        bool, typer.Option(help="Leave out the rows that need recordings of the test machine, which take minutes.")
    ] = True,
    as_json: Json = False,
) -> None:
    """Compute the papers' numbers and say of each whether it holds. Exit code 1 when one falls short.

    Rows of loops, friction, steps and power come from recordings of the simulated machine, which take minutes;
    --no-recordings leaves them out.
    """
    from ..reproduction import reproduce as run
    from ..reproduction.rows import select

    with progress("reproducing", len(select(part, row))) as advance:
        outcomes = run(
            part, row, progress=lambda r: advance(r.id), tell=lambda words: advance(words, 0), recordings=recordings
        )
    failed = sum(o.ok is False for o in outcomes)
    if as_json:
        print_json({"rows": [_as_json(o) for o in outcomes], "failed": failed})
    else:
        _print(outcomes, failed)
    if failed:
        raise typer.Exit(1)


def _as_json(o: Any) -> dict[str, Any]:
    return {
        "id": o.row.id,
        "paper": o.row.paper,
        "ours": o.ours,
        "unit": o.row.unit,
        "expect": o.row.expect,
        "ok": o.ok,
        "calibrated": o.row.calibrated,
        "verdict": o.verdict,
        "note": o.note,
    }


def _print(outcomes: list[Any], failed: int) -> None:
    rows = []
    for o in outcomes:
        if o.ours is None:
            continue
        paper = o.row.paper
        printed = " to ".join(f"{v:g}" for v in paper) if isinstance(paper, tuple) else f"{paper:g}"
        off = "" if isinstance(paper, tuple) or not paper else f"{100 * (o.ours / paper - 1):+.1f} %"
        rows.append(
            [o.row.id, printed, f"{o.ours:.4g}", "" if o.row.unit == "-" else o.row.unit, off, o.verdict, o.note]
        )
    table(
        "The papers, number by number",
        ["row", "paper", "ours", "unit", "off by", "verdict", "note"],
        rows,
        right=[1, 2, 4],
    )
    computed = sum(o.ours is not None for o in outcomes)
    typer.echo(
        f"\n{computed} of {len(outcomes)} rows computed, {failed} fall short, {len(outcomes) - computed} to come."
    )
